"""Causes under protocols that other labs drive and write, drawn at random (:mod:`rig.unusual`)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from rig import unusual
from rig.chain import force_of
from rig.conventions import CONVENTIONS
from rig.effects import shared_form
from rig.unusual import Unusual

from criticism.found import search
from mpam_calib.criticism.data.build import build_problem
from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.fitting.fit import chain_for, fit
from mpam_calib.criticism.fitting.forms import forms_of
from mpam_calib.criticism.searching.candidates import candidates
from mpam_calib.criticism.verdict import judge
from mpam_calib.model.blueprint import Options, draw_blueprint
from mpam_calib.specimen import read

NATS = 20.0
"""Misfit (half the whitened sum of squares) that the truth leaves at most."""
QUIET = 1e-4
"""Share of the noise that is left where misfit is judged."""
STARTS = (0.0, -1.5, 1.5)


def drawn(seeds: Iterable[int], count: int) -> list[Unusual]:
    """The tests of these seeds that there are."""
    made = (unusual.draw(seed, count) for seed in seeds)
    return [each for each in made if each is not None]


def _problem(made: Unusual, folder: Path) -> Problem:
    unusual.write(made, folder)
    specimen = read(folder)
    return build_problem(specimen, draw_blueprint(specimen, Options(nuisances=False, remainder=False)))


def _exact(made: Unusual) -> Unusual:
    """The same test by a rig whose encoders have no steps and that reads the pressure there is."""
    habits = replace(made.habits, force_step=0.0, displacement_step=0.0, pressure_step=0.0, decimals=6)
    return replace(made, habits=habits, rows=replace(made.rows, reading=made.rows.pressure))


def left(made: Unusual, folder: Path) -> float:
    """Nats that the best of the true causes' forms leave of nearly noiseless forces, by the usual noise."""
    made = _exact(made)
    shared = [(shared_form(i), size) for i, size in made.sizes.items()]
    true = force_of(made.case.muscle, made.rows, shared, seed=made.case.seed)
    quiet = replace(made, force=true + QUIET * (made.force - true))
    problem = _problem(made, folder / "loud").with_force(_problem(quiet, folder / "quiet").force)
    forms = product(*(forms_of(i) for i in made.sizes))
    return min(
        0.5 * fit(problem, frozenset(form), 0, start).chi2
        for form in map(frozenset, forms)
        for start in _starts(problem, form)
    )


def _starts(problem: Problem, form: frozenset[str]) -> list[dict[str, float]]:
    """Several starts for the sizes of one or two parameters."""
    plain, whole = (
        {p.name for p in chain_for(problem.blueprint.model_dump_json(), f).parameters}
        for f in (frozenset[str](), form)
    )
    names = sorted(name for name in whole - plain if "_bend" not in name)
    if len(names) > 2:
        return [{}]
    return [dict(zip(names, at, strict=True)) for at in product(STARTS, repeat=len(names))]


def verdict(made: Unusual, folder: Path) -> tuple[str, frozenset[str]]:
    """The word, and the causes that stand."""
    unusual.write(made, folder)
    specimen = read(folder)
    problem = build_problem(specimen, draw_blueprint(specimen, Options()))
    found = judge(search(problem, candidates(problem).tested))
    return found.word, found.standing


@pytest.mark.parametrize(("count", "seeds"), [(1, range(1)), (2, range(1))])
def test_the_truth_leaves_nothing(count: int, seeds: range, tmp_path: Path) -> None:
    for made in drawn(seeds, count):
        assert left(made, tmp_path / made.case.name) < NATS, (made.case.name, made.habits)


@pytest.mark.long
@pytest.mark.parametrize("count", [1, 2])
def test_the_truth_leaves_nothing_in_nineteen_of_twenty(
    count: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    all_made = drawn(range(100, 150), count)
    misfit = {made.case.name: left(made, tmp_path / made.case.name) for made in all_made}
    with capsys.disabled():
        print(f"\n{len(misfit)} tests; above {NATS:g} nats:", {k: v for k, v in misfit.items() if v > NATS})
    assert np.mean(np.array(list(misfit.values())) < NATS) >= 0.95


@pytest.mark.long
def test_nothing_is_named_where_nothing_is_hidden(tmp_path: Path) -> None:
    (made,) = drawn([1], 0)
    assert verdict(made, tmp_path / made.case.name) == ("adequate", frozenset()), made.habits


@pytest.mark.long
@pytest.mark.parametrize(("count", "share"), [(0, 0.95), (1, 0.85), (2, 0.75)])
def test_textbook_causes_are_named(
    count: int, share: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The truth alone, and hardly ever another set; sizes of 2.5 to 8 times the noise."""
    missed, wrong, all_made = {}, [], drawn(range(100, 130), count)
    for made in all_made:
        word, standing = verdict(made, tmp_path / made.case.name)
        truth = frozenset(made.sizes)
        if (word, standing) != (("named", truth) if truth else ("adequate", truth)):
            missed[made.case.name] = (word, sorted(standing), sorted(truth))
        if word == "named" and standing != truth:
            wrong.append(made.case.name)
    with capsys.disabled():
        print(f"\n{len(all_made)} tests; missed: {missed}")
    assert 1.0 - len(missed) / len(all_made) >= share
    assert len(wrong) <= 0.1 * len(all_made)


def named(convention: str, seeds: Iterable[int], folder: Path) -> tuple[int, list[str], int]:
    """How many tests with a cause by this convention name it alone, which another set, of how many."""
    right, wrong, count = 0, [], 0
    for seed in seeds:
        made = unusual.draw(seed, 1, convention)
        if made is not None:
            word, standing = verdict(made, folder / f"{convention}-{seed}")
            truth = frozenset(made.sizes)
            right += (word, standing) == ("named", truth)
            wrong += [f"{convention}-{seed}"] * (word == "named" and standing != truth)
            count += 1
    return right, wrong, count


@pytest.mark.long
@pytest.mark.parametrize("convention", CONVENTIONS)
def test_causes_by_other_conventions_are_named(
    convention: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    right, wrong, count = named(convention, range(100, 106), tmp_path)
    with capsys.disabled():
        print(f"\n{convention}: {right} of {count}, another set in {wrong}")
    assert right >= 0.75 * count
    assert len(wrong) <= 1
