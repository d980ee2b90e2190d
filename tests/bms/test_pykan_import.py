"""Networks trained with pykan: the same values here, in Python and in C, or a clear refusal."""

import dataclasses
import json
import pickle
import re
from pathlib import Path

import numpy as np
import pytest

from bms.errors import InputError, ModelMismatchError
from bms.firmware import CompiledNetwork, Firmware
from bms.kan.network import INPUT_NAMES
from bms.kan.scaling import Scaling
from bms.model.model_file import load_model, load_shipped_model
from bms.presets import DEFAULT_PRESET, load_preset
from bms.pykan_import import imported_model, imported_network, read_checkpoint, with_all_inputs
from bms.pykan_import.model import UNKNOWN_ERROR_K
from tests.bms.kan_samples import write_recording

torch = pytest.importorskip("torch", reason="not run: PyTorch is not installed")
kan = pytest.importorskip("kan", reason="not run: pykan is not installed")

DOCUMENT = Path(__file__).parents[2] / "docs" / "pykan.md"
CASES = Path(__file__).parents[3] / "shared" / "cases"
needs_cases = pytest.mark.skipif(
    not CASES.is_dir(), reason="not run: no failing inputs in ../shared/cases"
)
PARITY = 1e-5
"""Of the output's span."""


def trained(width, grid=2, k=3, updates=(0, 6), **options):
    """A network of pykan after some training, with grids that followed uneven samples."""
    torch.manual_seed(1)
    model = kan.KAN(width=list(width), grid=grid, k=k, seed=1, auto_save=False, **options)
    x = 2.0 * torch.rand(400, width[0]) ** 1.5 - 1.0
    y = torch.sin(2.0 * x[:, :1]) + 0.5 * (x[:, -1:] + 1.0) ** 2
    optimiser = torch.optim.Adam(model.get_params(), lr=0.02)
    for step in range(8):
        if step in updates:
            model.update_grid(x)
        optimiser.zero_grad()
        torch.mean((model(x) - y) ** 2).backward()
        optimiser.step()
    model(x)
    return model


def untrained(width):
    return kan.KAN(width=list(width), grid=3, k=3, seed=1, auto_save=False)


def saved(model, folder):
    """Path that pykan was given for the checkpoint."""
    model.saveckpt(str(folder / "net"))
    return folder / "net"


def network_of(model, folder):
    checkpoint = read_checkpoint(saved(model, folder))
    inputs = len(checkpoint.layers[0].knots)
    return imported_network(checkpoint, Scaling(np.zeros(inputs), np.ones(inputs), 0.0, 1.0))


def forward(model, points):
    return model(torch.tensor(points, dtype=torch.float32)).detach().numpy()[:, 0].astype(float)


def assert_same_values(model, network, trusted_share=0.95):
    """pykan's forward pass within PARITY wherever our estimate is trusted, in Python and in C."""
    points = np.random.default_rng(7).uniform(-1.0, 1.0, (3000, network.width[0]))
    points = points.astype(np.float32).astype(np.float64)
    expected = forward(model, points)
    compiled = CompiledNetwork(
        dataclasses.replace(load_shipped_model(DEFAULT_PRESET), network=network)
    )
    for values, in_domain in (network.evaluate(points), compiled.evaluate(points)):
        assert np.mean(in_domain) >= trusted_share
        worst = np.abs(values - expected)[in_domain].max()
        assert worst <= PARITY * np.ptp(expected)


@pytest.mark.parametrize(
    ("width", "grid", "k"),
    [
        ((4, 1, 1), 2, 3),
        ((2, 2, 1), 5, 3),
        ((3, 2, 2, 1), 3, 2),
        ((1, 1), 20, 3),
        ((4, 2, 1), 3, 4),
        ((8, 1, 1), 2, 1),
    ],
)
def test_values_are_those_of_pykans_forward_pass(width, grid, k, tmp_path):
    model = trained(width, grid, k)
    network = network_of(model, tmp_path)

    assert network.width == width
    assert network.degree == k
    spacing = np.diff(network.layers[0][0][0].knots)
    assert spacing.max() > 1.05 * spacing.min()
    assert_same_values(model, network)


def test_values_agree_where_pykan_was_never_given_a_grid(tmp_path):
    """Hidden values leave a grid that nobody updated; pykan's samples tell how far."""
    model = trained((4, 1, 1), updates=())
    with torch.no_grad():
        model.act_fun[0].scale_sp *= 3.0
        model(2.0 * torch.rand(600, 4) - 1.0)
    network = network_of(model, tmp_path)

    intervals = len(network.layers[1][0][0].coefficients) - 3
    assert 2 < intervals <= 2 + 2 * 3
    assert_same_values(model, network)


def test_without_room_for_wider_grids_what_is_beyond_them_is_flagged(tmp_path):
    """15 edges of 4 cells fill the firmware's tables, or nearly so."""
    model = trained((2, 5, 1), grid=4)
    network = network_of(model, tmp_path)

    assert {len(row[0].coefficients) for layer in network.layers for row in layer} == {4 + 3}
    assert_same_values(model, network, trusted_share=0.6)


def test_scales_and_shifts_of_nodes_are_folded_exactly(tmp_path):
    model = trained((2, 1, 1), grid=3)
    with torch.no_grad():
        for number in range(2):
            for name, value in (
                ("node_scale", 1.3),
                ("node_bias", -0.2),
                ("subnode_scale", 0.7),
                ("subnode_bias", 0.1),
            ):
                getattr(model, f"{name}_{number}").fill_(value)
    model.update_grid(2.0 * torch.rand(600, 2) - 1.0)

    assert_same_values(model, network_of(model, tmp_path))


def test_masked_edge_contributes_nothing(tmp_path):
    model = trained((3, 2, 1))
    model.remove_edge(0, 1, 0, log_history=False)
    network = network_of(model, tmp_path)

    edge = network.layers[0][0][1]
    assert edge.evaluate(np.linspace(-0.9, 0.9, 9), 3)[0] == pytest.approx(np.zeros(9))
    assert_same_values(model, network)


def test_beyond_the_grid_the_last_value_is_kept_and_flagged(tmp_path):
    model = trained((1, 1), grid=4)
    model.act_fun[0].grid.data *= 0.5
    model.cache_data = None
    network = network_of(model, tmp_path)
    edge = network.layers[0][0][0]

    values, in_domain = network.evaluate(np.array([[edge.knots[-4]], [0.7], [1.0]]))

    assert values[1] == values[2] == values[0]
    assert in_domain.tolist() == [True, False, False]


@pytest.mark.parametrize("spelling", ["net", "net_state", "net_config.yml", "net_cache_data"])
def test_checkpoint_is_named_as_in_pykan_or_by_any_of_its_files(spelling, tmp_path):
    saved(untrained((1, 1)), tmp_path)

    assert read_checkpoint(tmp_path / spelling).name == "net"


def refusal(path):
    with pytest.raises(InputError) as refused:
        checkpoint = read_checkpoint(path)
        inputs = len(checkpoint.layers[0].knots)
        imported_network(checkpoint, Scaling(np.zeros(inputs), np.ones(inputs), 0.0, 1.0))
    assert len(str(refused.value).splitlines()) == 1
    return str(refused.value)


def test_symbolic_edge_is_refused_by_layer_and_edge_until_it_is_unfixed(tmp_path):
    model = trained((2, 2, 1))
    model.fix_symbolic(0, 1, 0, "sin", fit_params_bool=False, verbose=False, log_history=False)

    told = refusal(saved(model, tmp_path))

    assert "layer 0, edge 1 -> 0" in told
    assert "'sin'" in told
    assert "unfix_symbolic(0, 1, 0)" in told
    model.unfix_symbolic(0, 1, 0, log_history=False)
    assert_same_values(model, network_of(model, tmp_path))


def test_edge_fixed_to_zero_gives_the_constant_that_pykan_gives(tmp_path):
    """pykan fits '0' as c * 0 + d, and d is not 0."""
    model = trained((3, 2, 1))
    model.fix_symbolic(0, 1, 0, "0", verbose=False, log_history=False)
    model.fix_symbolic(1, 0, 0, "0", fit_params_bool=False, verbose=False, log_history=False)
    with torch.no_grad():
        model.subnode_scale_0.fill_(0.7)
        model.node_scale_0.fill_(1.3)
        model.symbolic_fun[1].affine.data[0, 0, 3] = 0.4

    assert_same_values(model, network_of(model, tmp_path))


@needs_cases
def test_network_with_an_edge_fixed_to_zero_is_imported_with_pykans_values():
    prefix = CASES / "13-pykan-symbolic-message" / "csym_zero"
    assert_probe(prefix, None)


def test_refusal_of_a_symbolic_edge_is_the_whole_message(tmp_path):
    model = trained((2, 2, 1))
    model.fix_symbolic(0, 1, 0, "sin", fit_params_bool=False, verbose=False, log_history=False)

    told = refusal(saved(model, tmp_path))

    assert told.startswith(f"{tmp_path / 'net'}: layer 0")
    assert "Error" not in told
    assert "pykan 0.2.8" not in told


def assert_probe(prefix, input_id):
    """pykan's own values, kept beside the checkpoint, wherever the estimate is trusted."""
    checkpoint = with_all_inputs(read_checkpoint(prefix), input_id)
    network = imported_network(checkpoint, Scaling(np.zeros(4), np.ones(4), 0.0, 1.0))
    probe = np.load(f"{prefix}_probe.npz")
    points = probe["x"]
    if input_id is not None:
        points = np.zeros((len(probe["x"]), 4))
        points[:, input_id] = probe["x"][:, PROBE_COLUMNS]
    values, in_domain = network.evaluate(points.astype(np.float64))
    expected = probe["y"][:, 0]
    assert np.mean(in_domain) > 0.9
    assert np.abs(values - expected)[in_domain].max() <= PARITY * np.ptp(expected)


PROBE_COLUMNS = [0, 2, 3, 4]
"""Of the five inputs, those that the pruned network of the case was left with."""


@needs_cases
def test_network_after_prune_input_is_refused_until_its_inputs_are_named():
    prefix = CASES / "14-pykan-prune-input" / "cprune_input5"
    checkpoint = read_checkpoint(prefix)

    with pytest.raises(InputError, match="give its input_id, such as --input-id 0,1,2,3"):
        with_all_inputs(checkpoint, None)
    with pytest.raises(InputError, match="0 current, 1 cooling power"):
        with_all_inputs(checkpoint, [0, 2, 3, 4])
    assert_probe(prefix, [0, 1, 2, 3])
    assert_probe(prefix, [3, 0, 2, 1])


@pytest.mark.parametrize("left", [[0, 2, 3], [3, 0], [2]])
def test_pruned_network_reads_its_own_inputs_only(left, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # prune_input writes a log of its own
    whole = trained((4, 2, 1))
    pruned = whole.prune_input(active_inputs=left)
    points = np.random.default_rng(2).uniform(-1.0, 1.0, (500, 4)).astype(np.float32)
    pruned(torch.tensor(points))
    checkpoint = with_all_inputs(read_checkpoint(saved(pruned, tmp_path)), left)

    network = imported_network(checkpoint, Scaling(np.zeros(4), np.ones(4), 0.0, 1.0))

    assert network.input_names == INPUT_NAMES
    assert_same_values(pruned, network, trusted_share=0.9)
    away = points.astype(np.float64)
    for column in set(range(4)) - set(left):
        away[:, column] = -away[:, column]
    np.testing.assert_array_equal(
        network.evaluate(away)[0], network.evaluate(points.astype(np.float64))[0]
    )


@pytest.mark.parametrize("given", [[0, 2], [0, 2, 2], [0, 2, 4], [-1, 0, 2]])
def test_input_id_that_does_not_fit_is_refused(given, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # prune_input writes a log of its own
    pruned = trained((4, 1, 1)).prune_input(active_inputs=[0, 2, 3])

    with pytest.raises(InputError, match="--input-id"):
        with_all_inputs(read_checkpoint(saved(pruned, tmp_path)), given)


def test_base_function_as_an_object_is_read_without_making_it(tmp_path):
    prefix = saved(untrained((2, 1)), tmp_path)
    config = prefix.with_name("net_config.yml")
    for kind, is_read in (
        ("object:torch.nn.modules.activation.SiLU", True),
        ("object:torch.nn.modules.activation.Tanh", False),
        ("object/apply:os.system", False),
    ):
        text = re.sub(
            r"base_fun_name: .*", f"base_fun_name: !!python/{kind}\n- touch x", config.read_text()
        )
        text = text.replace("\n- touch x\n- touch x", "\n- touch x")
        config.write_text(text)
        if is_read:
            assert read_checkpoint(prefix).has_pruned_inputs
        else:
            assert "on every edge is not supported" in refusal(prefix)
    assert not Path("x").exists()


def test_inputs_that_were_not_scaled_are_refused(tmp_path):
    model = untrained((2, 1))
    model.update_grid(torch.rand(500, 2) * torch.tensor([1.0, 40.0]))

    assert "edges from input 1" in refusal(saved(model, tmp_path))


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"width": [2, [1, 1], 1]}, "multiplication"),
        ({"width": [2, 1], "base_fun": "identity"}, "'identity'"),
        ({"width": [2, 2]}, "2 outputs"),
        ({"width": [2, 1, 1], "k": [3, 2]}, "k: [3, 2]"),
    ],
)
def test_what_the_network_here_does_not_have_is_refused(options, told, tmp_path):
    model = kan.KAN(grid=3, auto_save=False, **options)

    assert told in refusal(saved(model, tmp_path))


def test_grid_on_one_point_is_refused(tmp_path):
    model = untrained((2, 1))
    model.update_grid(torch.zeros(500, 2))

    assert "do not rise" in refusal(saved(model, tmp_path))


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (lambda path: path("_state").unlink(), "no such file"),
        (lambda path: path("_config.yml").unlink(), "no such file"),
        (lambda path: path("_state").write_bytes(b"nothing"), "cannot be read as tensors"),
        (lambda path: path("_config.yml").write_text("[1, 2"), "not a configuration"),
        (lambda path: path("_config.yml").write_text("k: 3"), "base_fun_name"),
        (lambda path: torch.save([1.0], path("_state")), "no state"),
        (lambda path: torch.save({"a": torch.ones(1)}, path("_state")), "not laid out as pykan"),
    ],
)
def test_damaged_checkpoint_is_refused(spoil, told, tmp_path):
    prefix = saved(untrained((2, 1)), tmp_path)

    spoil(lambda part: prefix.with_name(prefix.name + part))

    assert told in refusal(prefix)


def test_coefficients_that_are_not_finite_are_refused(tmp_path):
    model = untrained((2, 1))
    model.act_fun[0].coef.data[1, 0, 2] = torch.nan

    assert "not finite" in refusal(saved(model, tmp_path))


class Intruder:
    """Code that a pickle would run when it is read."""

    def __reduce__(self):
        return (Path.touch, (Path("intruder"),))


def test_code_in_a_checkpoint_is_not_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    prefix = saved(untrained((2, 1)), tmp_path)
    torch.save(Intruder(), f"{prefix}_state")
    (tmp_path / "raw_state").write_bytes(pickle.dumps(Intruder()))

    assert "cannot be read as tensors" in refusal(prefix)
    assert not (tmp_path / "intruder").exists()


def test_network_of_other_inputs_has_a_bound_that_the_ecu_refuses(tmp_path):
    checkpoint = read_checkpoint(saved(trained((2, 2, 1)), tmp_path))
    scaling = Scaling(np.zeros(2), np.ones(2), 0.0, 1.0)
    preset = load_preset(DEFAULT_PRESET)

    model = imported_model(checkpoint, imported_network(checkpoint, scaling), preset, None)

    assert model.error_bound_K == UNKNOWN_ERROR_K
    with pytest.raises(ModelMismatchError, match="inputs"):
        Firmware(preset, model)


def test_command_scales_inputs_and_output_and_tests_on_a_recording(bms, tmp_path):
    model = trained((4, 1, 1))
    recording = write_recording(tmp_path / "run.csv", rows=400)
    center, half = np.array([-10.0, 0.0, 300.0, 297.0]), np.array([9.0, 1.0, 6.0, 2.0])

    code, out, _ = bms(
        "import-pykan", saved(model, tmp_path), "--out", tmp_path / "model.json",
        "--center", ",".join(map(str, center)), "--half-range", ",".join(map(str, half)),
        "--output-center", "301", "--output-half-range", "4", "--data", recording, "--json",
    )  # fmt: skip

    assert code == 0
    result, imported = json.loads(out), load_model(tmp_path / "model.json")
    assert imported.network.input_names == INPUT_NAMES
    points = np.random.default_rng(3).uniform(-0.8, 0.8, (200, 4))
    values, in_domain = imported.network.evaluate(center + half * points)
    expected = 301.0 + 4.0 * forward(model, points)
    assert np.mean(in_domain) > 0.95
    np.testing.assert_allclose(values[in_domain], expected[in_domain], rtol=0.0, atol=1e-4)
    assert result["rmse_K"] == imported.errors["test"].overall.rmse_K
    assert result["samples"] == 400
    assert result["fits_firmware"] is True
    assert result["error_bound_K"] >= result["max_abs_error_K"]
    assert imported.training_hash is None


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["import-pykan", "{net}"], "--out"),
        (["import-pykan", "{tmp}/absent", "--out", "{tmp}/m.json"], "absent_config.yml"),
        (["import-pykan", "{net}", "--out", "{tmp}/no/m.json"], "cannot be written"),
        (["import-pykan", "{net}", "--out", "{tmp}/m.json", "--center", "1"], "--center"),
        (["import-pykan", "{net}", "--out", "{tmp}/m.json", "--half-range", "1,x"], "1,x"),
        (["import-pykan", "{net}", "--out", "{tmp}/m.json", "--half-range", "1,-1"], "half"),
        (["import-pykan", "{net}", "--out", "{tmp}/m.json", "--input-id", "0"], "--input-id"),
        (["import-pykan", "{net}", "--out", "{tmp}/m.json", "--input-id", "0,b"], "0,b"),
        (["import-pykan", "{net}", "--out", "{tmp}/m.json", "--preset", "nobody"], "nobody"),
        (["import-pykan", "{net}", "--out", "{tmp}/m.json", "--data", "x.csv"], "four inputs"),
        (
            ["import-pykan", "{net}", "--out", "{tmp}/m.json", "--output-half-range", "0"],
            "--output-half-range",
        ),
    ],
)
def test_wrong_use_is_one_line_on_stderr_and_exit_2(bms, tmp_path, arguments, told):
    places = {"tmp": tmp_path, "net": saved(untrained((2, 1)), tmp_path)}

    code, out, err = bms(*(argument.format(**places) for argument in arguments))

    assert code == 2
    assert out == ""
    assert told in err
    assert len(err.splitlines()) == 1
    assert not (tmp_path / "m.json").exists()


def test_example_of_the_documentation_runs(bms, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = DOCUMENT.read_text(encoding="utf-8")
    (example,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    (commands,) = re.findall(r"```sh\n(.*?)```", text, re.DOTALL)

    exec(compile(example, str(DOCUMENT), "exec"), {})
    for line in commands.strip().splitlines():
        assert bms(*line.split()[1:])[0] == 0

    model = load_model(tmp_path / "model.json")
    assert model.preset == DEFAULT_PRESET
    assert model.errors["test"].overall.rmse_K < 0.5
    assert Firmware(DEFAULT_PRESET, model).model.hash == model.hash
