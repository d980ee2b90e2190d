"""What the figures say, in words that are put together from them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from bms.rivals.comparison import Comparison, Row

_AT_THE_FLOOR = 1.1


def verdict(comparison: Comparison) -> list[str]:
    """Sentences on accuracy, cost, and on every network beside its rivals and the floor."""
    ran = [row for row in comparison.rows if row.errors]
    in_c = [row for row in ran if row.cost is not None]
    kans = [row for row in in_c if row.role == "kan"]
    best = min(in_c, key=lambda row: row.rmse_K)
    sentences = [
        f"Smallest RMSE: {best.name} with {best.rmse_K:.4f} K, given {best.given}"
        + _runner_up(best, in_c),
        f"{_cheapest(in_c)}",
    ]
    read = [row for row in in_c if row.read_rmse_K is not None]
    if read:
        steady = min(read, key=_read)
        sentences.append(
            f"With the sensors' noise and resolution: {steady.name} with {_read(steady):.4f} K."
        )
    sentences += [_about(kan, in_c) for kan in kans]
    floor = next((row for row in ran if row.role == "floor"), None)
    if floor is not None:
        sentences += [_beside_floor(kan, floor) for kan in kans if kan.is_static]
    return sentences


def _read(row: Row) -> float:
    assert row.read_rmse_K is not None
    return row.read_rmse_K


def _runner_up(best: Row, rows: Sequence[Row]) -> str:
    others = [row for row in rows if row.given != best.given]
    if not others:
        return "."
    other = min(others, key=lambda row: row.rmse_K)
    return (
        f"; the best of those given something else ({other.given}) is {other.name} with "
        f"{other.rmse_K:.4f} K, {other.rmse_K / best.rmse_K:.1f} times as much."
    )


def _cheapest(rows: Sequence[Row]) -> str:
    fewest = min(rows, key=lambda row: (_multiply_adds(row), _bytes(row)))
    return (
        f"Cheapest: {fewest.name} with {_multiply_adds(fewest)} multiply-adds and "
        f"{_bytes(fewest)} bytes, at {fewest.rmse_K:.4f} K."
    )


def _about(kan: Row, rows: Sequence[Row]) -> str:
    measures: tuple[Callable[[Row], float], ...] = (lambda r: r.rmse_K, _multiply_adds, _bytes)
    better = [
        row.name
        for row in rows
        if row is not kan
        and all(measure(row) <= measure(kan) for measure in measures)
        and any(measure(row) < measure(kan) for measure in measures)
    ]
    place = 1 + sum(row.rmse_K < kan.rmse_K for row in rows)
    sentence = f"{kan.name}: place {place} of {len(rows)} by RMSE ({kan.rmse_K:.4f} K)"
    if not better:
        return f"{sentence}; nothing is both as accurate and as cheap."
    return f"{sentence}; no less accurate and no dearer: {', '.join(better)}."


def _beside_floor(kan: Row, floor: Row) -> str:
    ratio = kan.rmse_K / floor.rmse_K
    place = "at the floor" if ratio <= _AT_THE_FLOOR else "above the floor"
    return (
        f"{kan.name} is {place}: {kan.rmse_K:.4f} K are {ratio:.2f} times the {floor.rmse_K:.4f} K "
        f"of {floor.name.removeprefix('floor of static maps: ')}."
    )


def _multiply_adds(row: Row) -> int:
    assert row.cost is not None
    return row.cost.multiply_adds


def _bytes(row: Row) -> int:
    assert row.cost is not None
    return row.cost.bytes
