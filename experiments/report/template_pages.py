"""Pages from templates: where these stand, and what they can call."""

from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from experiments.report.run_data import quoted, slug
from experiments.report.sampler_pages import inline
from experiments.run.record import write_text

TEMPLATES = Path(__file__).parent / "templates"


def template_environment(*folders: Path) -> Environment:
    """Templates by their names; of two that are called alike that of the earlier folder."""
    environment = Environment(
        loader=FileSystemLoader(folders),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["url"] = quoted
    environment.filters["slug"] = slug
    environment.filters["code"] = inline
    return environment


def copy_assets(source: Path, folder: Path) -> None:
    """Copy the scripts and style sheets beside the pages."""
    for asset in sorted(source.iterdir()):
        write_text(folder / asset.name, asset.read_text(encoding="utf-8"))
