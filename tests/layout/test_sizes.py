"""How large the house is: it may shrink, and every bound with it.

Each line says what a room may hold, in lines or files, and what is wanted of it (`CONTRIBUTING.md`
says why). A bound stands at the next hundred above what there is: who makes a room smaller lowers
it, and who needs more room first looks for what can go.
"""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PRODUCT = ("samplers", "renderer", "metrics", "experiments")
PAPERS = tuple(f"experiments/{name}" for name in ("wu2025", "ergun2012", "arbree2005", "wan2005"))
WEB = (".html", ".css", ".js")
LINES: dict[str, tuple[tuple[str, ...], tuple[str, ...], int, int]] = {
    # room: (folders, kinds of files, at most, wanted)
    "product": (PRODUCT, (".py",), 54_600, 38_000),
    "experiments": (("experiments",), (".py",), 29_100, 20_000),
    "maps": (("experiments/maps",), (".py",), 5_000, 4_500),
    "run": (("experiments/run",), (".py",), 6_100, 3_000),
    "report": (("experiments/report",), (".py",), 6_200, 4_500),
    "pages": (("experiments/report",), WEB, 1_600, 1_300),
    "papers": (PAPERS, (".py",), 4_200, 3_000),
    "questions": (("experiments/questions",), (".py",), 5_200, 3_300),
    "export": (("experiments/export",), (".py",), 700, 700),
    "cli": (("experiments/cli",), (".py",), 1_800, 900),
    "tests": (("tests",), (".py",), 31_600, 22_000),
}
MOST_FILES = 160
"""Python files of experiments."""
MOST_LINES_OF_A_FUNCTION = 80


def files(folders: tuple[str, ...], kinds: tuple[str, ...]) -> Iterator[Path]:
    for folder in folders:
        yield from (file for file in (ROOT / folder).rglob("*") if file.suffix in kinds)


def lines_of(folders: tuple[str, ...], kinds: tuple[str, ...]) -> int:
    return sum(len(file.read_text(encoding="utf-8").splitlines()) for file in files(folders, kinds))


@pytest.mark.parametrize("room", LINES)
def test_a_room_is_within_its_bound(room):
    folders, kinds, most, wanted = LINES[room]
    found = lines_of(folders, kinds)
    assert 0 < found <= most, f"{room} has {found} lines, and may have {most} ({wanted} wanted)"


def test_experiments_are_in_few_files():
    assert sum(1 for _ in files(("experiments",), (".py",))) <= MOST_FILES


def test_no_function_is_long():
    for file in files(PRODUCT, (".py",)):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef):
                first = min([node.lineno, *(one.lineno for one in node.decorator_list)])
                assert node.end_lineno is not None
                length = node.end_lineno - first + 1
                assert length <= MOST_LINES_OF_A_FUNCTION, f"{file}:{first} {node.name}: {length}"
