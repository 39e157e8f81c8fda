"""Pages about every public name, from the docstrings: `make docs`, or python -m, with a folder."""

import pkgutil
import sys
import warnings
from importlib import import_module
from pathlib import Path

from samplers import EnvlightError

PACKAGES = ("samplers", "renderer", "metrics", "experiments")


def write_pages(folder: Path, packages: tuple[str, ...] = PACKAGES) -> Path:
    """Write the pages of the packages into a new folder; returns its index.html.

    What pdoc warns of, such as a name that it cannot resolve, is an error.
    Raises EnvlightError where pdoc is not installed, or the folder holds something.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise EnvlightError(f"{folder}: it holds something already; name a new folder")
    try:
        import pdoc
        import pdoc.extract
        import pdoc.render
    except ImportError:
        raise EnvlightError("pdoc is not installed; pip install 'envlight[docs]'") from None
    modules: list[str] = []
    known: set[str] = set()
    for package in packages:
        module = import_module(package)
        found = pkgutil.walk_packages(module.__path__, f"{package}.")
        for name in (package, *(one.name for one in found)):
            if name not in known:  # pdoc finds a package's modules itself, without an __all__
                known.update(pdoc.extract.walk_specs([name]))
                modules.append(name)
        for name in getattr(module, "__all__", ()):
            vars(module)[name] = getattr(module, name)  # those that are loaded on first use, too
    pdoc.render.configure(docformat="markdown", search=len(packages) > 1)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        pdoc.pdoc(*modules, output_directory=folder)
    return folder / "index.html"


if __name__ == "__main__":
    print(write_pages(Path(sys.argv[1])))
