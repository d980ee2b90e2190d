"""What the figures say, in words that are put together from them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from bms.studies.rivals.comparison import Comparison, Row
from bms.studies.rivals.estimator import Cost
from bms.studies.rivals.floor import FLOOR

AT_THE_FLOOR = 1.1
"""A network within this factor of the best other map's RMSE is said to be at the floor."""


def verdict(comparison: Comparison) -> list[str]:
    """Sentences on accuracy, cost, and on every network beside its rivals and the floor."""
    rivals = [row for row in comparison.rows if row.cost is not None]
    networks = [row for row in rivals if row.role == "kan"]
    sentences = [_most_accurate(rivals), _cheapest(rivals)]
    read = {row.name: row.read_rmse_K for row in rivals if row.read_rmse_K is not None}
    if read:
        name, rmse_K = min(read.items(), key=lambda item: item[1])
        sentences.append(
            f"With noise and resolution of the sensors the smallest RMSE is that of {name}, "
            f"{rmse_K:.4f} K."
        )
    sentences += [_beside_rivals(network, rivals) for network in networks]
    others = [row for row in comparison.rows if row.errors and row.is_static and row.role != "kan"]
    floor = min(others, key=_rmse_K)
    sentences += [_beside_floor(network, floor) for network in networks if network.is_static]
    return sentences


def _most_accurate(rivals: Sequence[Row]) -> str:
    best = min(rivals, key=_rmse_K)
    sentence = f"Smallest RMSE: {best.name}, {best.rmse_K:.4f} K; it is given {best.given}."
    is_filter = best.role == "filter"
    others = [row for row in rivals if (row.role == "filter") != is_filter]
    if not others:
        return sentence
    other = min(others, key=_rmse_K)
    kind = "the fitted maps, which are given training data only," if is_filter else "the filters"
    return (
        f"{sentence} Of {kind} the best is {other.name}, {other.rmse_K:.4f} K, "
        f"{other.rmse_K / best.rmse_K:.1f} times as much."
    )


def _cheapest(rivals: Sequence[Row]) -> str:
    row = min(rivals, key=lambda one: (_cost(one).multiply_adds, _cost(one).bytes))
    return (
        f"Cheapest: {row.name}, {_cost(row).multiply_adds} multiply-adds and {_cost(row).bytes} "
        f"bytes; its RMSE is {row.rmse_K:.4f} K."
    )


def _beside_rivals(network: Row, rivals: Sequence[Row]) -> str:
    measures: tuple[Callable[[Row], float], ...] = (
        _shown_rmse_K,
        lambda row: _cost(row).multiply_adds,
        lambda row: _cost(row).bytes,
    )
    better = [
        row.name
        for row in rivals
        if all(measure(row) <= measure(network) for measure in measures)
        and any(measure(row) < measure(network) for measure in measures)
    ]
    place = 1 + sum(_shown_rmse_K(row) < _shown_rmse_K(network) for row in rivals)
    sentence = f"{network.name}: place {place} of {len(rivals)} by RMSE, {network.rmse_K:.4f} K"
    if not better:
        return f"{sentence}; nothing else is as accurate at no higher cost."
    return f"{sentence}; as accurate or better at no higher cost: {', '.join(better)}."


def _beside_floor(network: Row, floor: Row) -> str:
    ratio = network.rmse_K / floor.rmse_K
    place = "at the floor" if ratio <= AT_THE_FLOOR else "above the floor"
    return (
        f"{network.name} is {place} of static maps: {network.rmse_K:.4f} K is {ratio:.2f} times "
        f"the {floor.rmse_K:.4f} K of the best other map of the same inputs, "
        f"{floor.name.removeprefix(f'{FLOOR}: ')}."
    )


def _rmse_K(row: Row) -> float:
    return row.rmse_K


def _shown_rmse_K(row: Row) -> float:
    """As the table shows it: what is equal there is as accurate."""
    return round(row.rmse_K, 4)


def _cost(row: Row) -> Cost:
    assert row.cost is not None
    return row.cost
