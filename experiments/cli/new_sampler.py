"""What `envlight new` does: a file with a small sampler that works, to be changed."""

import keyword
import re
import sys
from importlib.resources import files
from pathlib import Path

from samplers import EnvlightError, sampler_names

NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")


def new_sampler(name: str, folder: Path) -> None:
    """Write FOLDER/NAME.py and say what to do with it.

    Raises EnvlightError for a name that no module or sampler can have, or where the file exists.
    """
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
