"""Combinations that training has never seen are told from those it has."""

import numpy as np
import pytest

from bms.errors import InputError
from bms.kan.domain import EVERYWHERE, Domain, domain_of
from bms.model.model_file import load_shipped_model
from bms.presets import one_cell_preset_names


def correlated(count=2000):
    """Second input equal to the first but for a little."""
    rng = np.random.default_rng(3)
    first = rng.uniform(-0.9, 0.9, count)
    return np.stack([first, first + rng.uniform(-0.05, 0.05, count)], axis=1)


def test_training_data_lie_inside_and_opposite_corners_of_their_box_outside():
    domain = domain_of(correlated())
    assert domain.contains(correlated()).all()
    assert domain.contains(np.array([[0.8, 0.8], [-0.8, -0.8]])).all()
    assert not domain.contains(np.array([[0.8, -0.8], [-0.8, 0.8]])).any()


def test_slabs_end_thirty_percent_of_their_width_beyond_the_data():
    domain = domain_of(correlated())
    along = correlated() @ np.asarray(domain.directions).T
    width = np.ptp(along, axis=0)
    assert np.asarray(domain.high) - along.max(axis=0) == pytest.approx(
        np.maximum(0.3 * width, 0.15)
    )


def test_an_input_that_never_varied_has_no_part_in_the_slabs():
    """The box says how far it may go; a slab would be narrower than the sensor's noise."""
    still = np.column_stack([correlated(), np.zeros(2000)])
    domain = domain_of(still)
    assert len(domain.directions) == 2
    assert domain.contains(np.array([[0.5, 0.5, 1.0], [0.5, 0.5, -1.0]])).all()
    assert not domain.contains(np.array([[0.8, -0.8, 0.0]])).any()
    assert domain_of(np.zeros((50, 2))) == EVERYWHERE


def test_not_a_number_is_nowhere_and_without_slabs_everything_else_is_inside():
    assert not domain_of(correlated()).contains(np.array([[np.nan, 0.0]])).any()
    assert EVERYWHERE.contains(np.array([[1e9, -1e9]])).all()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"low": (0.0,)}, "differ in length"),
        ({"directions": ((1.0,), (0.0, 1.0))}, "directions differ"),
        ({"low": (0.0, 2.0)}, "below its high"),
    ],
)
def test_a_domain_that_cannot_be_is_refused(changes, message):
    good = {"directions": ((1.0, 0.0), (0.0, 1.0)), "low": (0.0, 0.0), "high": (1.0, 1.0)}
    with pytest.raises(InputError, match=message):
        Domain(**{**good, **changes})


@pytest.mark.parametrize("name", one_cell_preset_names())
def test_shipped_models_flag_a_surface_far_from_any_coolant_it_could_have(name):
    """Each value lies in its own trained range."""
    network = load_shipped_model(name).network
    center, half = np.asarray(network.input_center), np.asarray(network.input_half_range)
    inside = np.array([[-10.0, 0.2, 302.0, 300.0]])
    torn = np.array([[0.0, 0.2, 316.0, 279.0]])
    assert np.all(np.abs((torn - center) / half) <= 1.0)
    assert network.evaluate(inside)[1].all()
    assert not network.evaluate(torn)[1].any()
