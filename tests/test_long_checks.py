"""What is too long for every test run was run on the files that lie here now."""

from __future__ import annotations

import shutil

import pytest

from tools.long_checks import FOLDER, ROOT, LongCheck, load_checks

CHECKS = load_checks()


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.name)
def test_the_kept_result_rests_on_the_files_here(check):
    assert check.is_current(), (
        f"what '{check.name}' rests on has changed since it was run; "
        f"run 'make long-checks CHECKS={check.name}' and commit {FOLDER}/{check.name}.json"
    )


def tree_with(tmp_path, text):
    (tmp_path / FOLDER).mkdir()
    (tmp_path / "input.c").write_text(text)
    return tmp_path


def test_a_result_is_kept_with_its_inputs_and_ends_with_them(tmp_path):
    tree = tree_with(tmp_path, "one")
    check = LongCheck("say", ("echo", '{"worst": 1}'), ("*.c",))
    assert not check.is_current(tree)
    assert check.run(tree)
    assert check.result(tree)["said"] == {"worst": 1}
    assert check.is_current(tree)
    (tree / "input.c").write_text("two")
    assert not check.is_current(tree)
    (tree / "input.c").write_text("one")
    assert check.is_current(tree)
    shutil.move(tree / "input.c", tree / "other.c")
    assert not check.is_current(tree)


def test_a_check_that_fails_keeps_nothing(tmp_path):
    tree = tree_with(tmp_path, "one")
    assert not LongCheck("fail", ("false",), ("*.c",)).run(tree)
    assert not (tree / FOLDER / "fail.json").exists()


def test_a_check_whose_inputs_change_meanwhile_keeps_nothing(tmp_path):
    tree = tree_with(tmp_path, "one")
    assert not LongCheck("change", ("sh", "-c", "echo two > input.c"), ("*.c",)).run(tree)
    assert not (tree / FOLDER / "change.json").exists()


def test_a_pattern_without_a_file_is_an_error(tmp_path):
    with pytest.raises(ValueError, match=r"checks\.toml: gone: no file for 'gone/\*\.c'"):
        LongCheck("gone", ("true",), ("gone/*.c",)).inputs_sha256(tree_with(tmp_path, "one"))


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.name)
def test_every_input_pattern_finds_files(check):
    assert len(check.inputs_sha256(ROOT)) == 64
