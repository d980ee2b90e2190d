"""The estimator on a measured core temperature; not run where the recording is absent."""

from pathlib import Path

import numpy as np
import pytest

from bms.data.measurements import Measurements, read_measurements
from bms.kan.settings import TrainingSettings
from bms.model.make import model_for_measurements

RECORDING = Path(__file__).parents[3] / "shared" / "data" / "a123_26650_hev_cycle_1.csv"
pytestmark = pytest.mark.skipif(
    not RECORDING.is_file(), reason=f"not run: the measured drive cycle {RECORDING} is absent"
)
LAGS_S = (10.0, 160.0)


def settings(lags_s):
    return TrainingSettings(width=(4 + 2 * len(lags_s), 1, 1), lag_time_constants_s=lags_s)


LAGGED = pytest.param(LAGS_S, 0.055, marks=pytest.mark.long("training"))


@pytest.mark.slow
@pytest.mark.parametrize(("lags_s", "rmse_K"), [((), 0.13), LAGGED])
def test_last_third_of_the_cycle_is_estimated_from_the_first_two(lags_s, rmse_K):
    model = model_for_measurements(RECORDING, settings(lags_s), lambda share: None)
    assert model.errors["test"].overall.rmse_K <= rmse_K
    assert model.errors["training"].overall.rmse_K <= rmse_K


@pytest.mark.long("training")
@pytest.mark.parametrize(("lags_s", "rmse_K"), [((), 0.13), (LAGS_S, 0.055)])
def test_first_third_is_estimated_from_the_last_two(tmp_path, lags_s, rmse_K):
    """Holds no choice made on the last third: here it trains, and the first third is unseen."""
    whole = read_measurements(RECORDING)
    rows = len(whole.time_s)
    order = np.concatenate([np.arange(rows // 3, rows), np.arange(rows // 3)])
    path = tmp_path / "swapped.csv"
    swapped = {name: getattr(whole, name)[order] for name in Measurements.__dataclass_fields__}
    swapped["time_s"] = whole.time_s
    table = np.column_stack(list(swapped.values()))
    np.savetxt(path, table, delimiter=",", header=",".join(swapped), comments="")

    model = model_for_measurements(path, settings(lags_s), lambda share: None)

    assert model.errors["test"].overall.rmse_K <= rmse_K
