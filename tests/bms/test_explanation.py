"""Explanations: slopes, formulas and errors against independent evaluation."""

import dataclasses
import json

import numpy as np
import pytest
from matplotlib.mathtext import MathTextParser

from bms.data.datasets import simulated_split
from bms.data.lags import Lag
from bms.data.simulate import joined
from bms.kan.network import INPUT_NAMES
from bms.model.model_file import load_shipped_model, save_model, shipped_model_path
from bms.presets import DEFAULT_PRESET, load_preset
from bms.studies.explanation import explain
from bms.studies.explanation.fitting import candidates, chosen
from bms.studies.explanation.propagation import node_values, sensitivities
from bms.studies.explanation.report import Subject, as_latex, as_text
from bms.studies.explanation.symbols import input_symbol
from tests.bms.kan_samples import random_network, write_recording

FUNCTIONS = {"exp": np.exp, "log": np.log, "sin": np.sin, "sqrt": np.sqrt, "tanh": np.tanh}
CENTER, HALF = np.array([-12.0, 1.0, 300.0, 295.0]), np.array([12.0, 1.0, 20.0, 15.0])
MATHTEXT = MathTextParser("agg")


def near_rest(count=4000, seed=0):
    """Inputs in the middle of the box, where hidden values stay within their grids."""
    return CENTER + HALF * np.random.default_rng(seed).uniform(-0.3, 0.3, (count, 4))


def by_text(explanation, inputs):
    """Core temperature by the printed steps, evaluated as Python."""
    names = dict(zip((input_symbol(name)[0] for name in INPUT_NAMES), inputs.T))
    for symbol, expression in explanation.formula.steps:
        names[symbol] = eval(expression, {"__builtins__": {}}, {**FUNCTIONS, **names})
    return names["Tc"]


@pytest.fixture(scope="module")
def shipped():
    """The shipped model with its explanation over simulated profiles."""
    model, preset = load_shipped_model(DEFAULT_PRESET), load_preset(DEFAULT_PRESET)
    kinds = simulated_split(preset, "training", 0, 4, model.network.lags)
    inputs = joined(kinds.values()).inputs
    return model, inputs, explain(model.network, inputs)


@pytest.mark.parametrize("width", [(4, 1, 1), (4, 3, 2, 1)])
def test_sensitivities_are_the_slopes_of_the_estimate(width):
    network, inputs = random_network(width, grid=3), near_rest(300)
    slopes = sensitivities(network, inputs)

    for column, step in enumerate(1e-6 * HALF):
        shift = step * np.eye(4)[column]
        above, inside_above = network.evaluate(inputs + shift)
        below, inside_below = network.evaluate(inputs - shift)
        inside = inside_above & inside_below
        assert np.count_nonzero(inside) > 100
        expected = (above - below) / (2.0 * step)
        np.testing.assert_allclose(slopes[inside, column], expected[inside], rtol=1e-4, atol=1e-4)


def test_node_values_end_in_the_normalised_estimate():
    network, inputs = random_network((4, 3, 1)), near_rest(50)

    outputs = node_values(network, inputs)[-1][:, 0]

    assert 305.0 + 25.0 * outputs == pytest.approx(network.evaluate(inputs)[0])


X = np.linspace(280.0, 320.0, 200)
U = (X - 300.0) / 20.0


@pytest.mark.parametrize(
    ("form", "values"),
    [
        ("constant", 0.0 * U + 7.0),
        ("linear", 3.0 - 0.2 * U),
        ("quadratic", 1.0 + U - 2.0 * U**2),
        ("cubic", U**3 - 0.3 * U**2 + 1.0),
        ("exp", 2.0 * np.exp(-1.7 * U) - 4.0),
        ("sqrt", 5.0 * np.sqrt(U + 1.4)),
        ("sqrt", 5.0 * np.sqrt(1.4 - U) - 1.0),
        ("log", -2.0 * np.log(U + 1.3)),
        ("log", -2.0 * np.log(1.3 - U)),
        ("sin", np.sin(5.0 * U + 1.0)),
        ("tanh", np.tanh(3.0 * (U - 0.2))),
        ("gaussian", 4.0 * np.exp(-((2.5 * (U + 0.3)) ** 2)) - 1.0),
        ("silu", 2.0 * 5.0 * (U - 0.1) / (1.0 + np.exp(-5.0 * (U - 0.1)))),
        ("silu", 2.0 * 5.0 * (0.1 - U) / (1.0 + np.exp(-5.0 * (0.1 - U)))),
    ],
)
def test_function_of_the_library_is_found(form, values):
    best = chosen(candidates(X, values, np.full(200, 1.0 / 200.0)))

    assert best.approximation.form == form
    np.testing.assert_allclose(best.approximation(X), values, atol=2e-3)


def test_simpler_form_is_preferred_when_about_as_good():
    shares = np.full(200, 1.0 / 200.0)
    barely_bent = U + 1e-3 * U**2
    bent = U + 0.1 * U**2

    assert chosen(candidates(X, barely_bent, shares)).approximation.form == "linear"
    assert chosen(candidates(X, bent, shares)).approximation.form == "quadratic"
    # In kelvin the same bend matters when the edge moves the estimate a hundred times as much.
    assert chosen(candidates(X, barely_bent, 1e4 * shares)).approximation.form == "quadratic"


def test_fit_follows_the_data_not_the_box():
    dense = np.where(U < 0.0, 1.0, 1e-9)
    kinked = np.maximum(U, 0.0)

    assert chosen(candidates(X, kinked, dense / dense.sum())).approximation.form == "constant"


def test_error_figures_are_kelvin_over_the_data():
    values = U**2
    linear = next(
        one
        for one in candidates(X, values, np.full(200, 9.0 / 200.0))
        if one.approximation.form == "linear"
    )

    error_K = 3.0 * (linear.approximation(X) - values)
    assert linear.rmse_K == pytest.approx(np.sqrt(np.mean(error_K**2)))
    assert linear.r_squared == pytest.approx(0.0, abs=1e-6)


def test_printed_formula_is_the_network_within_the_stated_error(shipped):
    model, inputs, explanation = shipped

    error_K = by_text(explanation, inputs) - model.network.evaluate(inputs)[0]

    assert np.sqrt(np.mean(error_K**2)) == pytest.approx(explanation.formula_rmse_K, rel=0.02)
    assert np.abs(error_K).max() == pytest.approx(explanation.formula_max_abs_error_K, rel=0.02)
    assert explanation.formula_max_abs_error_K < 0.05


def test_formula_in_one_piece_equals_its_steps(shipped):
    _, inputs, explanation = shipped
    names = dict(zip(("I", "Qc", "Ts", "Tinf"), inputs.T))

    composed = eval(explanation.formula.composed, {"__builtins__": {}}, {**FUNCTIONS, **names})

    np.testing.assert_allclose(composed, by_text(explanation, inputs), atol=1e-6)


def test_edges_are_explained_in_physical_units_with_their_data(shipped):
    model, inputs, explanation = shipped
    network = model.network

    for source, edge in enumerate(explanation.edges[0][0]):
        x = (edge.x - network.input_center[source]) / network.input_half_range[source]
        expected = network.layers[0][0][source].evaluate(x, network.degree)[0]
        np.testing.assert_allclose(edge.values, expected, atol=1e-12)
        assert edge.bins[0] == pytest.approx(inputs[:, source].min())
        assert edge.bins[-1] == pytest.approx(inputs[:, source].max())
        assert edge.density.sum() == pytest.approx(1.0)
    last = explanation.edges[-1][0][0]
    assert np.ptp(last.values) > 10.0  # kelvin, not normalised


def test_quiet_input_is_a_constant():
    inputs = near_rest(500)
    inputs[:, 1] = 1.0

    edge = explain(random_network((4, 1, 1)), inputs).edges[0][0][1]

    assert edge.approximation.form == "constant"
    assert edge.max_abs_error_K < 1e-4


def test_sensitivity_of_the_box_leaves_out_what_is_flagged(shipped):
    model, _, explanation = shipped

    assert [one.name for one in explanation.sensitivities] == list(INPUT_NAMES)
    surface = explanation.sensitivities[2]
    assert surface.box_K.min() > 0.5
    assert surface.data_K.min() >= surface.box_K.min() - 0.05
    box = np.stack([one.box_x for one in explanation.sensitivities], axis=1)
    np.testing.assert_allclose(surface.box_K, sensitivities(model.network, box)[:, 2])


def lagged_network():
    lags = (Lag("current_squared_A2", 10.0), Lag("surface_temperature_rise_K", 2.5))
    plain = random_network((4, 2, 1), grid=3)
    extra = tuple(
        tuple((*row, row[0], row[1]) if number == 0 else row for row in layer)
        for number, layer in enumerate(plain.layers)
    )
    return dataclasses.replace(
        plain,
        layers=extra,
        lags=lags,
        input_names=(*INPUT_NAMES, *(lag.input_name for lag in lags)),
        input_center=(*plain.input_center, 200.0, 0.0),
        input_half_range=(*plain.input_half_range, 200.0, 1.0),
    )


def test_latex_of_every_formula_can_be_set():
    network = lagged_network()
    inputs = np.hstack([near_rest(500), np.random.default_rng(1).uniform(0.0, 1.0, (500, 2))])
    explanation = explain(network, inputs)
    subject = Subject("a_b.json", "0" * 64, network.input_names, "50 % of run_1.csv")

    formulas = [text for step in explanation.formula.latex_steps for text in step]
    for text in (*formulas, explanation.formula.latex_composed):
        MATHTEXT.parse(f"${text}$")
    document = as_latex(subject, explanation)
    for name in ("document", "itemize", "tabular"):
        assert document.count(rf"\begin{{{name}}}") == document.count(rf"\end{{{name}}}") == 1
    assert document.count("{") == document.count("}")
    assert document.count("$") % 2 == 0
    assert r"a\_b.json" in document
    assert r"50 \% of run\_1.csv" in document
    assert all(ord(letter) < 128 for letter in document)
    assert "I2lag_10s" in as_text(subject, explanation)
    assert "dTslag_2_5s" in as_text(subject, explanation)


def test_command_writes_the_same_files_each_time(bms, tmp_path):
    recording = write_recording(tmp_path / "run.csv", rows=400)
    model = tmp_path / "model.json"
    save_model(
        dataclasses.replace(load_shipped_model("lin2014"), network=random_network((4, 2, 1))), model
    )

    runs = [
        bms("explain", "--model", model, "--data", recording, "--out", tmp_path / name, "--json")
        for name in ("one", "two")
    ]

    assert [code for code, _, _ in runs] == [0, 0]
    names = sorted(path.name for path in (tmp_path / "one").iterdir())
    assert names == [
        "edges_layer1.png",
        "edges_layer2.png",
        "explanation.json",
        "explanation.tex",
        "explanation.txt",
        "sensitivity.png",
    ]
    for name in names:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    content = json.loads(runs[0][1])
    assert content["data"] == "run.csv"
    assert len(content["edges"]) == 4 * 2 + 2
    assert set(content["sensitivity_K_per_unit"]) == set(INPUT_NAMES)
    assert content["sensitivity_K_per_unit"]["current_A"]["unit"] == "K/A"


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--model", "{model}"], "--out"),
        (["--model", "{tmp}/absent.json", "--out", "{tmp}/o"], "absent.json"),
        (["--model", "{model}", "--out", "{model}", "--data", "{data}"], "cannot be made"),
        (["--model", "{model}", "--out", "{tmp}/o", "--data", "{model}"], "column time_s"),
        (["--model", "{model}", "--out", "{tmp}/o", "--preset", "nobody"], "nobody"),
        (["--model", "{model}", "--out", "{tmp}/o", "--preset", "x", "--data", "{data}"], "both"),
    ],
)
def test_wrong_use_is_one_line_on_stderr_and_exit_2(bms, tmp_path, arguments, told):
    recording = write_recording(tmp_path / "run.csv", rows=300)
    places = {"tmp": tmp_path, "model": shipped_model_path(DEFAULT_PRESET), "data": recording}

    code, out, err = bms("explain", *(argument.format(**places) for argument in arguments))

    assert code == 2
    assert out == ""
    assert told in err
    assert len(err.splitlines()) == 1
    assert not (tmp_path / "o").exists()
