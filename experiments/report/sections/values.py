"""The values of one metric, case by case, as papers print them that show a few images."""

from collections.abc import Iterator

from experiments.report.parts import Part, Table
from experiments.run.experiment import Section
from experiments.run.loaded_run import Run
from metrics.registry import find_metric


def value_per_case(name: str) -> Section:
    """The section: a line per budget, scene and map, a column per sampler; means over seeds."""

    def section(run: Run) -> Iterator[Part]:
        metric = find_metric(name)
        case = ["budget", "scene", "environment"]
        values = run.rows.groupby([*case, "sampler"], sort=False)[name].mean().unstack("sampler")
        samplers = [label for label in run.samplers if label in values]
        formats = dict.fromkeys(case, "s") | dict.fromkeys(samplers, f".{metric.digits}f")
        headings = dict(zip(samplers, samplers, strict=True))
        caption = f"{metric.label} by case; means over seeds."
        rows = values[samplers].reset_index()
        yield Table(f"{name}_by_case", rows, formats, headings, caption=caption)

    return section
