"""The commands about a sampler of the user's own: `envlight check` and `new`.

Heavy imports stand inside, so that `--help` answers at once.
"""

import json
import keyword
import re
import sys
import textwrap
from dataclasses import asdict, dataclass
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from experiments.progress import telling

if TYPE_CHECKING:
    from experiments.run.sampler_spec import SamplerSpec
    from samplers import LightSampler

WIDTH = 96
NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")


@dataclass(frozen=True)
class Finding:
    """The outcome of one check.

    status : "left out" where the check says nothing of such a sampler or an earlier one must be
        passed first; "allowed" for a failure that is known
    expected, seen, look : what the check wants, what it met, where to look; empty where it passed,
        but for a sentence about what it saw
    """

    check: str
    status: Literal["passed", "failed", "allowed", "left out"]
    expected: str = ""
    seen: str = ""
    look: str = ""


def check(
    sampler: Annotated[
        str,
        typer.Argument(help="A sampler's name or FILE:CLASS; parameters in brackets: ours\\[a=1]."),
    ],
    allow: Annotated[
        list[str] | None, typer.Option(help="A check that may fail; commas or repeatable.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was found as JSON.")] = False,
) -> None:
    """Run the conformance suite on a sampler; says what is wrong and where to look."""
    from experiments.maps.patterns import split_list
    from experiments.run.sampler_spec import single_sampler
    from samplers import EnvlightError
    from samplers.conformance.exceptions import EXCEPTIONS
    from samplers.conformance.suite import CHECKS

    spec = single_sampler(sampler)
    reasons = dict.fromkeys(split_list(allow or []), "--allow") | EXCEPTIONS.get(spec.name, {})
    unknown = [name for name in reasons if name not in CHECKS]
    if unknown:
        raise EnvlightError(f"no check is called '{unknown[0]}'; there are {', '.join(CHECKS)}")
    with telling(f"checking {spec.label}"):
        findings = check_sampler(spec, reasons)
    failed = sum(finding.status == "failed" for finding in findings)
    if as_json:
        found = [asdict(finding) for finding in findings]
        print(json.dumps({"sampler": spec.label, "checks": found}, indent=2, ensure_ascii=False))
    else:
        for finding in findings:
            print(_told(finding))
        total = sum(finding.status != "left out" for finding in findings)
        print(f"{spec.label}: {failed} of {total} checks failed" if failed else
              f"{spec.label}: all {total} checks passed")  # fmt: skip
    raise typer.Exit(1 if failed else 0)


def check_sampler(spec: "SamplerSpec", reasons: dict[str, str]) -> list[Finding]:
    """All checks in their order.

    reasons : checks that may fail, and why; one of them that passes is a failure, as it says what
        is not true
    """
    from samplers.conformance.suite import CHECKS, applies

    sampler = spec.sampler
    findings: list[Finding] = []
    for name in CHECKS:
        if findings and findings[0].status == "failed":
            findings.append(Finding(name, "left out", seen="the first check must be passed first"))
        elif name != "lighting" and not applies(name, sampler):
            findings.append(Finding(name, "left out", seen="it says nothing of this kind"))
        else:
            findings.append(_finding(name, sampler, reasons.get(name)))
    return findings


def _finding(name: str, sampler: "LightSampler", reason: str | None) -> Finding:
    from samplers.conformance.advice import ADVICE
    from samplers.conformance.lighting_check import contained
    from samplers.conformance.suite import CHECKS, Nonconformance

    expected = " ".join((CHECKS[name].__doc__ or "").split())
    try:
        with contained():
            remark = CHECKS[name](sampler)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # what somebody else's sampler may do is not known
        seen = str(error) if isinstance(error, Nonconformance) else _raised(error)
        if reason is not None:
            return Finding(name, "allowed", expected, seen, reason)
        return Finding(name, "failed", expected, seen, ADVICE[name])
    if reason is not None:
        return Finding(name, "failed", "that it fails, as it is allowed to", "it passed",
                       "the list of what is allowed: take it out")  # fmt: skip
    return Finding(name, "passed", seen=remark or "")


def _raised(error: BaseException) -> str:
    """An exception, and the line of a user's own file that it went through."""
    from samplers.errors import EnvlightError, told
    from samplers.files.plug_in_files import line_of

    said = " ".join(str(error).split()) if isinstance(error, EnvlightError) else told(error)
    return f"it raised, at {line_of(error) or 'no line of its own'}: {said}"


def _told(finding: Finding) -> str:
    mark = {"passed": "ok", "left out": "–"}.get(finding.status, finding.status)
    lines = [f"{mark:8}{finding.check}"]
    if finding.status in ("left out", "passed") and finding.seen:
        lines[0] += f" ({finding.seen})"
    elif finding.status == "allowed":
        lines[0] += f" ({finding.look})"
    elif finding.status == "failed":
        for name in ("expected", "seen", "look"):
            head = f"{'':8}{name + ':':10}"
            lines += textwrap.wrap(
                getattr(finding, name), WIDTH, initial_indent=head, subsequent_indent=" " * 18
            )
    return "\n".join(lines)


def new(
    name: Annotated[str, typer.Argument(help="Lower case with underscores, e.g. my_sampler.")],
    folder: Annotated[Path, typer.Option(help="Where the file goes.")] = Path(),
) -> None:
    """Begin a sampler: writes NAME.py, a small one that works, to be changed."""
    from samplers import EnvlightError, sampler_names

    if not NAME.fullmatch(name) or keyword.iskeyword(name):
        raise EnvlightError(
            f"'{name}': name a new sampler in lower case with underscores, as in my_sampler"
        )
    hyphenated, path = name.replace("_", "-"), folder / f"{name}.py"
    if hyphenated in sampler_names():
        raise EnvlightError(f"'{name}': a sampler is called '{hyphenated}' already; take another")
    if name in sys.stdlib_module_names:
        raise EnvlightError(f"'{name}': a module of Python is called so; take another name")
    cls = "".join(part.capitalize() for part in name.split("_"))
    text = (files("samplers.files") / "data" / "new_sampler.py").read_text("utf-8")
    text = text.replace("my-sampler", hyphenated).replace("MySampler", cls)
    text = text.replace("My sampler", name.replace("_", " ").capitalize())
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise EnvlightError(f"{path}: it exists; remove it or take another name") from None
    place = path if path.is_absolute() else f"./{path}"
    print(
        f"{path}: written. Edit `_prepare`, then\n"
        f"  envlight check {place}:{cls}\n"
        f"  envlight run table1 --samplers {place}:{cls},ours,mis,median-cut"
    )
