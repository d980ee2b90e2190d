"""Steps of a chain are taken when what they read has changed, and not again."""

from __future__ import annotations

from hil_sim.chain.run import take_all
from hil_sim.chain.state import STATE_FILE, State, load_state
from hil_sim.chain.steps import Outcome, Step


def counted(name, reads=(), key=""):
    """A step that writes how often it was taken."""

    def run(folder):
        path = folder / f"{name}.txt"
        path.write_text(f"{int(path.read_text()) + 1 if path.exists() else 1}")
        return Outcome(name, (f"{name}.txt",))

    return Step(name, reads, key, run)


def taken_again(folder, *chain):
    return [one.name for one in take_all(folder, chain, print, lambda: 0.0) if not one.is_kept]


def test_a_step_is_taken_again_for_other_inputs_or_another_choice(tmp_path):
    chain = [counted("a"), counted("b", ("a.txt",)), counted("c")]
    assert taken_again(tmp_path, *chain) == ["a", "b", "c"]
    assert taken_again(tmp_path, *chain) == []
    assert taken_again(tmp_path, *chain[:2], counted("c", key="seed 1")) == ["c"]
    (tmp_path / "a.txt").write_text("7")
    assert taken_again(tmp_path, *chain[:2], counted("c", key="seed 1")) == ["a", "b"]


def test_state_of_another_format_counts_as_none(tmp_path):
    (tmp_path / STATE_FILE).write_text('{"format": 0}')
    assert load_state(tmp_path) == State()
