"""Parts of a checkpoint: everything that sampling keeps comes back as it was, nothing else is built."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from mpam_calib.atomic_files import sweep, write_atomically
from mpam_calib.criticism.selection.held_out import LEVEL_COLUMNS
from mpam_calib.errors import Interrupted
from mpam_calib.posterior.chains.checkpoint import Checkpoint
from mpam_calib.posterior.chains.ensembles import Block, EnsembleState
from mpam_calib.posterior.chains.packing import pack, unpack
from mpam_calib.posterior.chains.proposal import StudentMixture
from mpam_calib.posterior.density.mode import Mode
from mpam_calib.posterior.evidence.bridge import Bridge
from mpam_calib.specimen.declaration import Simulation


@pytest.fixture
def checkpoint(tmp_path: Path) -> Checkpoint:
    return Checkpoint(tmp_path / "parts", "digest")


def block() -> Block:
    rng = np.random.RandomState(3)
    rng.standard_normal()  # half of a pair is kept back: part of the state
    state = EnsembleState(
        rng.standard_normal((4, 2)), np.array([-1.0, -np.inf, np.nan, 2.0]), rng.get_state()
    )
    return Block(rng.standard_normal((5, 4, 2)), np.zeros((5, 4)), 0.1 + 0.2, state)


def test_a_block_comes_back_with_its_random_state(checkpoint: Checkpoint) -> None:
    saved = block()
    checkpoint.save("block_00000", [saved, saved])
    loaded = checkpoint.load("block_00000")
    assert isinstance(loaded, list) and len(loaded) == 2
    again = loaded[1]
    assert type(again) is Block
    np.testing.assert_array_equal(again.chain, saved.chain)
    np.testing.assert_array_equal(again.state.log_prob, saved.state.log_prob)
    assert again.accepted == saved.accepted
    one, other = np.random.RandomState(), np.random.RandomState()
    one.set_state(saved.state.random)
    other.set_state(again.state.random)
    np.testing.assert_array_equal(one.standard_normal(9), other.standard_normal(9))


def test_other_things_that_are_kept_come_back(checkpoint: Checkpoint) -> None:
    mode = Mode(np.array([1.0, 2.0]), -3.5, np.eye(2))
    mixture = StudentMixture.build([mode.u], [mode.covariance])
    part = (None, [mode], mixture, {"a": (1, 2.5, "x", True)}, np.float64(0.1), 2**200, float("inf"))
    checkpoint.save("part", part)
    loaded = checkpoint.load("part")
    assert type(loaded) is tuple
    assert loaded[0] is None and loaded[3:] == part[3:]
    assert type(loaded[4]) is np.float64
    np.testing.assert_array_equal(loaded[1][0].covariance, mode.covariance)
    np.testing.assert_array_equal(loaded[2].roots, mixture.roots)


def test_declarations_named_tuples_sets_and_tables_come_back(checkpoint: Checkpoint) -> None:
    simulation = Simulation(order=2, law="linear", effects=("dead_band",))
    table = pd.DataFrame({"level": [1.5, np.nan], "rows": [3, 4], "told": [True, False]})
    part = [simulation, Bridge(1.0, 0.1), frozenset({"b", "a"}), table]
    checkpoint.save("part", part)
    loaded = checkpoint.load("part")
    assert isinstance(loaded, list)
    assert loaded[:3] == part[:3] and type(loaded[1]) is Bridge
    pd.testing.assert_frame_equal(loaded[3], table)


def test_tables_of_texts_and_empty_ones_come_back(checkpoint: Checkpoint) -> None:
    for table in (
        pd.DataFrame({"model": ["first", None], "rows": [3, 4]}),
        pd.DataFrame([], columns=LEVEL_COLUMNS),
    ):
        checkpoint.save("part", table)
        pd.testing.assert_frame_equal(checkpoint.load("part"), table)


def test_arrays_keep_their_order_in_memory(checkpoint: Checkpoint) -> None:
    square = np.arange(12.0).reshape(3, 4)
    checkpoint.save("part", [square, np.asfortranarray(square), square.T])
    loaded = checkpoint.load("part")
    assert isinstance(loaded, list)
    for array, same in zip(loaded, (square, square, square.T), strict=True):
        np.testing.assert_array_equal(array, same)
    assert [a.flags.f_contiguous for a in loaded] == [False, True, True]


def test_clearing_leaves_what_is_not_a_part(checkpoint: Checkpoint) -> None:
    checkpoint.save("part", 1.0)
    assert checkpoint.begun and not Checkpoint(checkpoint.folder, "another").begun
    (checkpoint.folder / "notes.txt").write_text("mine")
    checkpoint.clear()
    assert [p.name for p in checkpoint.folder.iterdir()] == ["notes.txt"]
    (checkpoint.folder / "notes.txt").unlink()
    checkpoint.clear()
    assert not checkpoint.folder.exists() and not checkpoint.begun


def test_an_interruption_says_whether_something_is_kept(checkpoint: Checkpoint) -> None:
    with pytest.raises(Interrupted, match="nothing was done yet"), checkpoint.resumable():
        raise KeyboardInterrupt
    checkpoint.save("part", 1.0)
    with pytest.raises(Interrupted, match="what was done is kept"), checkpoint.resumable():
        raise KeyboardInterrupt
    other = Checkpoint(checkpoint.folder, "another")
    with pytest.raises(Interrupted, match="nothing was done yet"), other.resumable():
        raise KeyboardInterrupt


def test_what_is_not_there_or_not_ours_is_missing(checkpoint: Checkpoint) -> None:
    assert checkpoint.load("part") is None
    checkpoint.save("part", [1.0])
    assert checkpoint.load("part") == [1.0]
    assert Checkpoint(checkpoint.folder, "another").load("part") is None
    checkpoint.clear()
    assert checkpoint.load("part") is None


def test_any_changed_or_lost_byte_counts_as_missing(checkpoint: Checkpoint) -> None:
    checkpoint.save("part", block())
    path = checkpoint.folder / "part.checkpoint"
    whole = path.read_bytes()
    for at in range(0, len(whole), 97):
        path.write_bytes(whole[:at])
        assert checkpoint.load("part") is None
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 4]) + whole[at + 1 :])
        assert checkpoint.load("part") is None
    path.write_bytes(whole)
    assert checkpoint.load("part") is not None


def test_a_pickle_is_never_run(checkpoint: Checkpoint, tmp_path: Path) -> None:
    class Trap:
        def __reduce__(self) -> Any:
            return Path.touch, (tmp_path / "sprung",)

    checkpoint.folder.mkdir()
    (checkpoint.folder / "part.checkpoint").write_bytes(pickle.dumps(Trap()))
    assert checkpoint.load("part") is None
    with pytest.raises(TypeError, match="cannot hold"):
        checkpoint.save("part", Trap())
    with pytest.raises(ValueError, match="allow_pickle"):
        checkpoint.save("part", np.array([Trap()], dtype=object))
    assert not (tmp_path / "sprung").exists()


@pytest.mark.parametrize("name", ["os:system", "pathlib:Path", "mpam_calib.cli:main", "mpam_calib.errors:x"])
def test_only_values_of_this_package_are_built(
    name: str, checkpoint: Checkpoint, monkeypatch: pytest.MonkeyPatch
) -> None:
    from mpam_calib.posterior.chains import packing as module

    forged = {"class": name, "fields": {}}
    monkeypatch.setattr(module, "_encode", lambda part, store: forged)
    payload = pack(None, "digest")
    with pytest.raises(module.Damaged):
        unpack(payload, "digest")


def test_a_write_that_fails_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text("old")

    def fail(temporary: Path) -> None:
        temporary.write_text("ne")
        raise RuntimeError("disk full")

    with pytest.raises(RuntimeError):
        write_atomically(path, fail)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["table.csv"]


@pytest.mark.skipif(os.name != "posix", reason="elsewhere nobody can remove an open file")
def test_what_another_process_is_writing_is_not_swept(tmp_path: Path) -> None:
    table = tmp_path / "table.csv"
    code = (
        "import sys; from pathlib import Path;"
        "from mpam_calib.atomic_files import write_atomically;"
        "write_atomically(Path(sys.argv[1]), lambda p: (p.write_text('whole'), print('begun', flush=True),"
        "sys.stdin.read()))"
    )
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", code, str(table)], stdin=pipe, stdout=pipe) as writer:
        assert writer.stdout is not None and writer.stdout.readline() == b"begun\n"
        sweep(tmp_path)
        writer.communicate()
    assert writer.returncode == 0
    assert table.read_text() == "whole"
    (tmp_path / f".table.csv.{writer.pid}.abc.part").write_text("ne")
    sweep(tmp_path)
    assert list(tmp_path.iterdir()) == [table]


def test_what_a_killed_process_left_is_swept(tmp_path: Path) -> None:
    (tmp_path / ".table.csv.abc.part").write_text("ne")
    (tmp_path / f".table.csv.{os.getpid()}.abc.part").write_text("ne")
    (tmp_path / ".keep").write_text("mine")
    sweep(tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == [".keep"]
