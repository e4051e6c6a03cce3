"""An existing RUN: kept, replaced, gone on with, left alone."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from mpam_calib.run import diagnose, select
from mpam_calib.run import folder as run_folder
from mpam_calib.run.files import MARKS
from mpam_calib.run.kept import Kept

from .command import FAST, RESULTS, Here, contents, stamps
from .small import loops_text, tensile_text

SPOIL: dict[str, Callable[[bytes], bytes]] = {
    "modes": lambda part: b"\x80\x05.",
    "warm_up": lambda part: b"",
    "block_00000": lambda part: part[: len(part) // 2],
    "block_00001": lambda part: part[:-100] + bytes([part[-100] ^ 1]) + part[-99:],
}


def state(run: Path) -> dict[str, object]:
    content: dict[str, object] = json.loads((run / "run.json").read_text())
    return content


@pytest.fixture
def own_material(material: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(material, tmp_path / "own"))


@pytest.fixture
def own_run(material_run: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(material_run, tmp_path / "own_run"))


def test_a_finished_run_holds_its_files_and_no_others(muscle_run: Path) -> None:
    assert set(contents(muscle_run)) == set(RESULTS)


def test_a_finished_run_is_kept(own_material: Path, own_run: Path, here: Here) -> None:
    before = stamps(own_run)
    result = here("calibrate", own_material, "-o", own_run)
    assert result.code == 0
    assert "kept" in result.out
    assert stamps(own_run) == before


@pytest.mark.parametrize("command", ["calibrate", "select", "diagnose", "reproduce"])
def test_what_others_left_is_not_written_over(
    own_material: Path, tmp_path: Path, here: Here, command: str
) -> None:
    others = tmp_path / "others"
    others.mkdir()
    (others / "report.html").write_text("mine")
    result = here(command, *([] if command == "reproduce" else [own_material]), "-o", others)
    assert result.code == 2
    assert "report.html: found a file that no run wrote, expected a new folder" in result.err
    assert contents(others) == {"report.html": b"mine"}


WRITTEN = {
    "calibrate": (*run_folder.WRITTEN, *run_folder.DERIVED),
    "select": select.FILES,
    "diagnose": diagnose.FILES,
}
OF_OTHERS = [(command, name) for command, names in WRITTEN.items() for name in names if name not in MARKS]


@pytest.mark.parametrize(("command", "name"), OF_OTHERS)
def test_no_file_of_others_is_written_over_or_removed(
    muscle: Path, tmp_path: Path, here: Here, command: str, name: str
) -> None:
    """Whatever a command writes, or takes away with an older result, its own mark has to stand beside it."""
    others = tmp_path / "others"
    (others / name).parent.mkdir(parents=True)
    (others / name).write_text("mine")
    result = here(command, muscle, "-o", others)
    assert result.code == 2
    assert "that no run wrote" in result.err or "that no diagnosis wrote" in result.err
    assert contents(others) == {name: b"mine"}


def test_nor_are_data_beside_which_a_diagnosis_would_extend_them(
    muscle: Path, tmp_path: Path, here: Here
) -> None:
    own = tmp_path / "run" / "extended" / "loops.csv"
    own.parent.mkdir(parents=True)
    own.write_text("mine")
    assert "that no diagnosis wrote" in here("diagnose", muscle, "-o", tmp_path / "run").complaint
    assert own.read_text() == "mine"


@pytest.mark.parametrize("command", ["calibrate", "select", "diagnose"])
def test_nothing_goes_into_the_folder_of_a_reproduction(
    own_material: Path, tmp_path: Path, here: Here, command: str
) -> None:
    repro = tmp_path / "repro"
    repro.mkdir()
    (repro / "reproduction.csv").write_text("source\n")
    (repro / "report.html").write_text("its page")
    before = contents(repro)
    result = here(command, own_material, "-o", repro)
    assert result.code == 2
    assert "found a reproduction's folder" in result.err
    assert contents(repro) == before


def test_a_run_that_was_killed_while_it_wrote_is_still_a_run(
    own_material: Path, own_run: Path, here: Here
) -> None:
    (own_run / "run.json").unlink()
    (own_run / "checkpoint").mkdir()
    assert here("calibrate", own_material, "-o", own_run, *FAST).code in (0, 3)
    assert state(own_run)


def test_a_smaller_budget_keeps_what_has_converged(own_material: Path, own_run: Path, here: Here) -> None:
    before = stamps(own_run)
    assert here("calibrate", own_material, "-o", own_run, "--max-steps", 1).code == 0
    assert stamps(own_run) == before


@pytest.mark.parametrize("steps", [1, 3])
def test_chains_too_short_to_tell_have_not_converged(
    steps: int, own_material: Path, tmp_path: Path, here: Here
) -> None:
    assert here("calibrate", own_material, "-o", tmp_path / "run", "--max-steps", steps).code == 3
    assert state(tmp_path / "run")["converged"] is False


def test_a_damaged_posterior_is_drawn_again(
    own_material: Path, own_run: Path, material_run: Path, here: Here
) -> None:
    posterior = own_run / "posterior.nc"
    whole = posterior.read_bytes()
    for spoilt in (whole[: len(whole) // 2], b"", b"\0" * len(whole)):
        posterior.write_bytes(spoilt)
        refused = here("predict", own_run)
        assert refused.code == 2
        assert refused.complaint.startswith(f"error: {posterior}: found a damaged file, expected the draws")
    result = here("calibrate", own_material, "-o", own_run)
    assert result.code == 0 and "kept" not in result.out
    for name in ("summary.csv", "bands.csv", "run.json"):
        assert (own_run / name).read_bytes() == (material_run / name).read_bytes()
    assert "kept" in here("calibrate", own_material, "-o", own_run).out


@pytest.mark.parametrize("change", ["seed", "data", "model"])
def test_another_digest_replaces(change: str, own_material: Path, own_run: Path, here: Here) -> None:
    before = contents(own_run)
    (own_run / "predictions.csv").write_text("of the run before\n")
    options: list[object] = []
    if change == "seed":
        options = ["--seed", 1]
    elif change == "data":
        (own_material / "tensile.csv").write_text(tensile_text(seed=5))
    else:
        declaration = own_material / "specimen.toml"
        declaration.write_text(declaration.read_text().replace("order = 2", "order = 3"))
    result = here("calibrate", own_material, "-o", own_run, *options)
    assert result.code == 0
    after = contents(own_run)
    assert set(after) == set(RESULTS)
    for name in ("summary.csv", "bands.csv", "run.json"):
        assert after[name] != before[name]


def test_a_small_budget_exits_3_and_a_larger_one_goes_on(
    own_material: Path, tmp_path: Path, here: Here
) -> None:
    run, other = tmp_path / "run", tmp_path / "other"
    much = ("--ess", 1e6)
    result = here("calibrate", own_material, "-o", run, *much, "--max-steps", 40)
    assert result.code == 3
    assert state(run)["converged"] is False
    assert set(RESULTS) <= set(contents(run))
    assert "--max-steps" in result.out
    first = stamps(run / "checkpoint")
    assert "block_00000.checkpoint" in first and "block_00001.checkpoint" not in first

    # The same budget has nothing to add.
    before = stamps(run)
    assert here("calibrate", own_material, "-o", run, *much, "--max-steps", 40).code == 3
    assert stamps(run) == before

    (run / "predictions.csv").write_text("of the shorter run\n")
    assert here("calibrate", own_material, "-o", run, *much, "--max-steps", 80).code == 3
    after = stamps(run / "checkpoint")
    assert "block_00001.checkpoint" in after
    assert {name: after[name] for name in first} == first
    assert not (run / "predictions.csv").exists()

    # Byte for byte what one run with the larger budget draws, parts that were damaged meanwhile included.
    longer = contents(run)
    (run / "run.json").unlink()
    for name, spoil in SPOIL.items():
        part = run / "checkpoint" / f"{name}.checkpoint"
        part.write_bytes(spoil(part.read_bytes()))
    for again in (run, other):
        assert here("calibrate", own_material, "-o", again, *much, "--max-steps", 80).code == 3
        for name in ("summary.csv", "bands.csv", "run.json"):
            assert (again / name).read_bytes() == longer[name]


@pytest.mark.parametrize("budget", [10, pytest.param(30, marks=pytest.mark.long)])
def test_what_a_budget_cut_short_is_drawn_whole_by_a_larger_one(
    budget: int, own_material: Path, material_run: Path, tmp_path: Path, here: Here
) -> None:
    run = tmp_path / "run"
    here("calibrate", own_material, "-o", run, "--max-steps", budget)
    short = state(run)["sampling"]
    assert isinstance(short, dict) and short["steps"] == budget
    assert here("calibrate", own_material, "-o", run).code == 0
    for name in ("summary.csv", "bands.csv", "run.json"):
        assert (run / name).read_bytes() == (material_run / name).read_bytes()
    assert "kept" in here("calibrate", own_material, "-o", run).out


def test_bad_input_leaves_an_existing_run_alone(
    muscle: Path, run_copy: Path, tmp_path: Path, here: Here
) -> None:
    spoilt = Path(shutil.copytree(muscle, tmp_path / "spoilt"))
    lines = loops_text().splitlines()
    lines[7] = lines[7].replace(",", ",x", 1)
    (spoilt / "loops.csv").write_text("\n".join(lines) + "\n")
    before = stamps(run_copy)
    result = here("calibrate", spoilt, "-o", run_copy, *FAST)
    assert result.code == 2
    assert result.complaint.startswith(f"error: {spoilt / 'loops.csv'}:8:pressure_kPa: found ")
    assert stamps(run_copy) == before
    fresh = tmp_path / "deep" / "fresh"
    assert here("calibrate", spoilt, "-o", fresh, *FAST).code == 2
    assert not fresh.parent.exists()


def test_too_little_data_for_the_model_writes_nothing(muscle: Path, tmp_path: Path, here: Here) -> None:
    few = Path(shutil.copytree(muscle, tmp_path / "few"))
    (few / "loops.csv").write_text(loops_text(levels=(150.0,)))
    result = here("calibrate", few, "-o", tmp_path / "fresh", *FAST)
    assert result.code == 2
    assert result.complaint.startswith("error: ")
    assert not (tmp_path / "fresh").exists()


def test_an_output_that_cannot_be_a_folder_is_refused(muscle: Path, tmp_path: Path, here: Here) -> None:
    file = tmp_path / "file"
    file.write_text("mine")
    for output in (file, file / "run"):
        result = here("calibrate", muscle, "-o", output, *FAST)
        assert result.code == 2
        assert result.complaint.startswith(f"error: {file}: found a file, expected a folder")
    assert file.read_text() == "mine"


@pytest.mark.parametrize("command", ["calibrate", "select", "diagnose"])
def test_results_do_not_mix_with_a_specimen(command: str, muscle: Path, tmp_path: Path, here: Here) -> None:
    specimen = Path(shutil.copytree(muscle, tmp_path / "own"))
    before = stamps(specimen)
    result = here(command, specimen, "-o", specimen)
    assert result.code == 2
    assert result.complaint.startswith(
        f"error: {specimen}: found a specimen's folder, expected one of its own"
    )
    assert stamps(specimen) == before


@pytest.mark.long
def test_another_command_s_page_is_not_kept_as_a_calibration_s(
    muscle: Path, run_copy: Path, here: Here
) -> None:
    assert here("calibrate", muscle, "-o", run_copy).code == 0
    own = contents(run_copy)
    assert here("diagnose", muscle, "-o", run_copy).code == 0
    assert (run_copy / "report.html").read_bytes() != own["report.html"]
    assert "written" in here("calibrate", muscle, "-o", run_copy).out
    assert (run_copy / "report.html").read_bytes() == own["report.html"]
    assert "kept" in here("calibrate", muscle, "-o", run_copy).out
    assert "written" in here("diagnose", muscle, "-o", run_copy).out


def test_a_diagnosis_leaves_its_source_and_others_specimens_alone(
    muscle: Path, tmp_path: Path, here: Here
) -> None:
    run = tmp_path / "run"
    own = Path(shutil.copytree(muscle, run / "extended"))
    before = stamps(run)
    for source, folder, found in (
        (own, run, "the folder whose extended/ is diagnosed"),
        (muscle, own, "a specimen that no diagnosis wrote"),
    ):
        result = here("diagnose", source, "-o", run)
        assert result.code == 2
        assert result.complaint.startswith(f"error: {folder}: found {found}, expected another")
        assert stamps(run) == before


@pytest.mark.parametrize("command", ["calibrate", "select", "diagnose"])
def test_results_do_not_replace_the_run_of_the_moduli(
    command: str, muscle: Path, own_run: Path, tmp_path: Path, here: Here
) -> None:
    specimen = Path(shutil.copytree(muscle, tmp_path / "specimen"))
    declaration = specimen / "specimen.toml"
    text = declaration.read_text().replace('moduli = "loops"', f'moduli = "run:../{own_run.name}"')
    declaration.write_text(text.replace('law = "linear"', 'law = "constant"'))
    before = stamps(own_run)
    result = here(command, specimen, "-o", own_run)
    assert result.code == 2
    assert result.complaint.startswith(f"error: {own_run}: found the run that the moduli come from")
    assert stamps(own_run) == before


def test_a_command_tidies_up_after_itself_alone(tmp_path: Path) -> None:
    (tmp_path / "unfinished").mkdir()
    (tmp_path / "unfinished" / "notes.txt").write_text("mine")
    kept = [
        Kept(tmp_path, command, digest * 32, ()) for command, digest in (("select", "a"), ("diagnose", "b"))
    ]
    older = Kept(tmp_path, "diagnose", "c" * 32, ())
    for one in (*kept, older):
        one.unfinished.save("part", 1.0)
    kept[1].finish()
    assert kept[0].unfinished.begun and not kept[1].unfinished.begun and not older.unfinished.begun
    kept[0].finish()
    assert [p.name for p in (tmp_path / "unfinished").iterdir()] == ["notes.txt"]


def test_a_run_file_of_another_kind_is_no_run(tmp_path: Path, here: Here) -> None:
    (tmp_path / "run.json").write_text("[]")
    result = here("predict", tmp_path)
    assert result.code == 2
    assert "found no finished run" in result.complaint


@pytest.mark.parametrize("target", ["nothing", "small"])
def test_moduli_of_a_run_that_is_none_are_refused(
    target: str, muscle: Path, tmp_path: Path, here: Here
) -> None:
    specimen = Path(shutil.copytree(muscle, tmp_path / "small"))
    declaration = specimen / "specimen.toml"
    text = declaration.read_text().replace('moduli = "loops"', f'moduli = "run:../{target}"')
    declaration.write_text(text.replace('law = "linear"', 'law = "constant"'))
    result = here("calibrate", specimen, "-o", tmp_path / "fresh")
    assert result.code == 2
    assert target in result.complaint and "finished run" in result.complaint
    assert not (tmp_path / "fresh").exists()
