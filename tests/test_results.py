"""The figures of the pages are those of results/, and results/ says how each was made."""

import json
import re

import pytest
from programs import ROOT, tool

from kpopnet.errors import InputError

results = tool("results")
ROWS = results.rows()
FILES = sorted(results.RESULTS.glob("**/*.json"))


def test_every_row_says_how_when_and_where_it_was_made():
    assert {path.stem for path in FILES} >= ROWS.keys()
    for name, row in ROWS.items():
        made = results.load(name)
        assert made["commands"] == row["commands"] and f"outputs/results/{name}" in made["commands"][-1]
        assert re.fullmatch(r"[0-9a-f]{12}", made["commit"]) and re.fullmatch(r"\d{4}-\d\d-\d\d", made["date"])
        benchmark = made["benchmark"]
        origin = benchmark["depth"] if "depth" in benchmark else benchmark["origin"]  # of dances
        assert made["machine"] and origin in ("real", "simulated")
        assert not benchmark.get("failed_sequences")
        if origin == "simulated":
            seed = benchmark["seed"] if "seed" in benchmark else re.search(r"seed (\d+)", benchmark["about"])[1]
            assert f"seed={seed} " in " ".join(made["commands"])


@pytest.mark.parametrize("changed", [None, "docs", "kpopnet"])
def test_a_row_names_the_commit_of_the_code_that_was_measured(tmp_path, monkeypatch, changed):
    """Whatever is committed while its commands run, which may take hours."""

    def git(*words):
        return results.subprocess.run(["git", *words], cwd=tmp_path, check=True, capture_output=True, text=True).stdout.strip()

    for name in (*results.CODE, "docs", "results", "outputs/results/row"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "file").touch()
    (tmp_path / "outputs/results/row/metrics.json").write_text('{"benchmark": {}, "estimators": {}}')
    for words in (("init", "-q"), ("config", "user.name", "me"), ("config", "user.email", "me"), ("add", ".")):
        git(*words)
    git("commit", "-qm", "before")
    begun = git("rev-parse", "--short=12", "HEAD")
    commands = [f"cp results/file.py {changed}", "git add .", "git commit -qm during"] if changed else []
    (tmp_path / "results" / "file.py").touch()
    monkeypatch.setattr(results, "ROOT", tmp_path)
    monkeypatch.setattr(results, "RESULTS", tmp_path / "results")
    monkeypatch.setattr(results, "rows", lambda: {"row": {"commands": commands}})
    if changed == "kpopnet":
        with pytest.raises(InputError, match="row: kpopnet, synth or configs changed while it was measured"):
            results.make("row")
    else:
        results.make("row")
        assert results.load("row")["commit"] == begun


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_file_names_its_commit_and_commands(path):
    made = json.loads(path.read_text())
    code, commands = made.get("commit") or made["code"], made.get("commands") or made["command"]
    assert code and commands and made["date"], path


@pytest.mark.parametrize("page", [*results.PAGES, *results.ALSO], ids=lambda path: path.name)
def test_the_tables_of_a_page_are_those_of_the_files(page):
    text = page.read_text()
    assert results.filled(text) == text, f"{page}: run `python tools/results.py pages`"


@pytest.mark.parametrize("page", results.PAGES, ids=lambda path: path.name)
def test_every_figure_of_a_page_is_in_a_file(page):
    for shown, reference in results.referenced(page.read_text()):
        assert reference, f"{page.name}: {shown} names no file of results/"
        assert results.states(shown, results.figure(reference)), f"{page.name}: {shown} is not {reference}"


def leaves(found, keys=()):
    """The paths of all numbers in nested dicts and lists, as a reference writes them."""
    if isinstance(found, dict | list):
        for key, one in found.items() if isinstance(found, dict) else enumerate(found):
            yield from leaves(one, (*keys, str(key)))
    else:
        yield "/".join(keys)


@pytest.mark.parametrize("file", ["earlier", "before_upright"])
def test_earlier_figures_are_kept_only_where_a_page_shows_them(file):
    shown = {reference for page in results.PAGES for _, reference in results.referenced(page.read_text())}
    (rooms,) = results.tomllib.loads((results.RESULTS / "tables.toml").read_text())["rooms"]
    in_table = f"{rooms['before']}:{{}}/{rooms['estimator']}/{{}}/map_10cm"
    shown |= {in_table.format(row, scene) for row in rooms["rows"] for scene in rooms["scenes"]}
    kept = {name: one for name, one in results.load(file).items() if name not in ("what", "commit", "date", "commands")}
    assert {f"{file}:{path}" for path in leaves(kept) if not path.endswith("/commit")} <= shown


def test_a_figure_is_held_to_its_digits():
    assert results.states("98.8", 0.98751) and results.states("2.46", 2.4649) and results.states("97", 0.9691)
    assert not results.states("98.8", 0.98749) and not results.states("2.46", 2.4651) and not results.states("0.97", 97)


def test_every_figure_is_found_with_what_it_refers_to():
    page = "12.3 % of 4.5 cm<!-- a:b/2 -->, 7<!-- c:d e/f-g --> (-2<!-- c:h -->); 6 dances, within 9 cm, 95 % intervals, `3 cm`"
    assert list(results.referenced(page)) == [("12.3", ""), ("4.5", "a:b/2"), ("7", "c:d e/f-g"), ("-2", "c:h")]


def test_people_are_resampled_over_all_rows():
    """Two rows of six people; a person of many joints counts more, and a seed is no unit."""
    people = {
        f"person {k}": {"map_10cm": k / 5, "labelled_joints": 100 * (k + 1), "missing_joints": 0, "moving_joints": 0}
        for k in range(6)
    }
    value = results.pooled([{"per_person": people}, {"per_person": people}])
    assert value.value == pytest.approx(sum(k / 5 * (k + 1) for k in range(6)) / 21)
    assert value.interval[0] < value.value < value.interval[1] and value.interval[1] - value.interval[0] > 0.15
    assert results.pooled([{"per_person": dict(list(people.items())[:4])}]).interval is None


def test_figures_that_name_their_file_are_renewed_in_their_digits_and_units(monkeypatch):
    numbers = {"a:within": 0.98765, "a:error": 2.3456, "a:low": -0.0412, "a:false": 71}
    monkeypatch.setitem(results.filled.__globals__, "figure", numbers.__getitem__)
    old = "12.3 %<!-- a:within --> of 4.56 cm<!-- a:error --> (-3.1<!-- a:low --> to 5), 9<!-- a:false -->"
    assert (
        results.filled(old)
        == "98.8 %<!-- a:within --> of 2.35 cm<!-- a:error --> (-4.1<!-- a:low --> to 5), 71<!-- a:false -->"
    )


def test_the_readme_sums_the_dances_in_order_of_the_sets():
    def in_order(rows, estimator):
        loaded = [results.load(f"kpop_sim_{row}") for row in rows]
        return [
            sum(
                round(one["benchmark"]["dances"] * one["estimators"][estimator]["scorers"][name]["concordance"] / 100)
                for one in loaded
            )
            for name in ("dance22", "paper", "raptis")
        ]

    composed = [in_order((2407, 2409, 2410), estimator) for estimator in ("truth", "network", "tracker")]
    text = (ROOT / "README.md").read_text().partition("Dance scores on **simulated** dances")[2].partition("\n")[0]
    stated = re.findall(r"\d+", text.replace("Eqs. 13 to 15", "").replace("[17]", ""))
    by_scorer = [number for of_scorer in zip(*composed, strict=True) for number in of_scorer]
    recorded = [
        number
        for row, seen_by in (("recorded_2413", ("truth", "network", "tracker")), ("in_profile_2413", ("network", "tracker")))
        for estimator in seen_by
        for number in in_order((row,), estimator)
    ]
    assert [*map(int, stated)] == [120, *by_scorer, 22, *recorded]
