"""Every open choice of every sampler, as data: the readings that are compared, and what is none.

A reading is listed for every value that a careful author might have meant, that of the default
among them: which one the default is, the sampler itself says, so that a default that moves needs no
change here. `NOT_OPEN` names the parameters that are no choice, each with the reason. A parameter
that stands in neither speaks for itself in its sampler's file: all values of a `Literal` or `bool`
are readings, and of others those of the field's metadata `readings`, unless the metadata has a
reason `fixed` why it is no choice.
"""

from dataclasses import Field, dataclass, fields
from functools import cache
from typing import Any, Literal, get_args, get_origin, get_type_hints

from experiments.run.sampler_spec import SamplerSpec
from samplers import sampler_class, sampler_names
from samplers.lighting import LIGHT_EXTENT, LightExtent


@dataclass(frozen=True)
class Reading:
    """sampler : as registered; choice : in words; parameters : what it sets, by name"""

    sampler: str
    choice: str
    parameters: tuple[tuple[str, Any], ...]

    @property
    def spec(self) -> SamplerSpec:
        """The sampler, its defaults left out."""
        default = {field.name: field.default for field in fields(sampler_class(self.sampler))}
        changed = ((k, v) for k, v in self.parameters if k not in default or default[k] != v)
        return SamplerSpec(self.sampler, tuple(changed))

    @property
    def is_default(self) -> bool:
        """Whether it is what the sampler does anyway."""
        return not self.spec.parameters


def _reading(sampler: str, choice: str, **parameters: Any) -> Reading:
    return Reading(sampler, choice, tuple(parameters.items()))


PERTURBED = (
    "fhis", "kollig-keller", "lightgen", "median-cut", "ours", "q2-tree", "structured", "tmms",
    "uniform", "variance-minimization",
)  # fmt: skip
"""Samplers whose lights are perturbed by what their parameter `light_extent` says."""
LISTED = (
    _reading("center-surround", "sizes in equal steps", spacing="linear"),
    _reading("center-surround", "sizes in equal ratios", spacing="geometric"),
    _reading("center-surround", "sizes are diameters", extent="diameter"),
    _reading("center-surround", "sizes are radii", extent="radius"),
    _reading("center-surround", "inner radius 0.75 as an angle", inner_in="angle"),
    _reading("center-surround", "inner radius 0.75 in the plane", inner_in="plane"),
    _reading("center-surround", "weights by solid angle", surface="sphere"),
    _reading("center-surround", "weights by the plane's area", surface="plane"),
    _reading("center-surround", "brightest 10 % of the pixels", brightest_by="count"),
    _reading("center-surround", "brightest 10 % of the sphere", brightest_by="solid angle"),
    _reading("fhis", "lights at the centroids of cells", light="centroid"),
    _reading("fhis", "lights of cells at the points", light="cell"),
    _reading("fhis", "equal lights at the points", light="point"),
    _reading("fhis", "one tiling, perturbed", sets="perturbed"),
    _reading("fhis", "eight shifts of the tiling", sets="shifted"),
    _reading("fhis", "points corrected", correct=True),
    _reading("fhis", "raw tiling", correct=False),
    _reading("filtered-importance-sampling", "blurred by a level more", bias=1.0),
    _reading("filtered-importance-sampling", "blurred by no level more", bias=0.0),
    _reading("filtered-importance-sampling", "blurred by two levels more", bias=2.0),
    _reading("kd-tree", "blocks split by squared error", selection="sse"),
    _reading("kd-tree", "blocks split by variance", selection="variance"),
    _reading("kd-tree", "blocks split by range", selection="range"),
    _reading("kd-tree", "pixels weighted by solid angle", weighting="solid-angle"),
    _reading("kd-tree", "pixels weighted alike", weighting="pixels"),
    _reading("kd-tree", "density by the block's exact mass", pdf_form="exact-mass"),
    _reading("kd-tree", "density by the law where it was drawn", pdf_form="paper-continuous"),
    _reading("kd-tree", "density by the law at the block's number", pdf_form="paper-integer"),
    _reading("kd-tree", "blocks drawn by an alias table", pdf_form="exact"),
    _reading("kd-tree", "blocks drawn by a walk down the tree", pdf_form="walk"),
    _reading("kd-tree", "uniform in solid angle within a block", placement="solid-angle"),
    _reading("kd-tree", "uniform in angles within a block", placement="angles"),
    _reading("kd-tree", "low-discrepancy numbers", numbers="low-discrepancy"),
    _reading("kd-tree", "independent numbers", numbers="independent"),
    _reading("kollig-keller", "new lights where light is drawn", addition="random"),
    _reading("kollig-keller", "new lights at the brightest pixel", addition="brightest"),
    _reading("lightgen", "searches begin by light", start="random"),
    _reading("lightgen", "searches begin by k-means++", start="k-means++"),
    _reading("lightgen", "best of five searches", searches=5),
    _reading("lightgen", "one search", searches=1),
    _reading("median-cut", "the region of largest energy is cut", order="heap"),
    _reading("median-cut", "all regions are cut once a round", order="rounds"),
    _reading("median-cut", "lights at the energy centroid", position="centroid"),
    _reading("median-cut", "lights at the middle", position="middle"),
    _reading("median-cut", "longer side on the sphere", aspect=True),
    _reading("median-cut", "longer side in pixels", aspect=False),
    _reading("mis", "low-discrepancy numbers", numbers="low-discrepancy"),
    _reading("mis", "independent numbers", numbers="independent"),
    _reading("mis-compensated", "low-discrepancy numbers", numbers="low-discrepancy"),
    _reading("mis-compensated", "independent numbers", numbers="independent"),
    _reading("ours", "draws mask their neighbourhood", masking=True),
    _reading("ours", "no masking", masking=False),
    _reading("ours", "k-means", kmeans=True),
    _reading("ours", "no k-means", kmeans=False),
    _reading("ours", "neighbourhood s·4π/K in radians", radius_unit="radians"),
    _reading("ours", "neighbourhood s·4π/K as a solid angle", radius_unit="solid_angle"),
    _reading("ours", "far emissive pixels given back after k-means", exclusion="converged"),
    _reading("ours", "far emissive pixels given back in each round", exclusion="each-round"),
    _reading("ours", "far emissive pixels kept", exclusion="none"),
    _reading("ours", "one search by k-means", searches=1),
    _reading("ours", "best of five searches by k-means", searches=5),
    _reading("ours", "the original illumination cut", extent_weight=0.0, energy_weight=0.0),
    _reading("ours", "light tree cut along the box's longer side", tree_axis="box"),
    _reading("ours", "light tree cut along the principal axis", tree_axis="principal"),
    _reading("ours", "light tree cut at half of the solid angle", tree_median="solid_angle"),
    _reading("ours", "light tree cut at half of the energy", tree_median="energy"),
    _reading("ours", "variance of a node as a sum", variance="sum"),
    _reading("ours", "variance of a node as a mean", variance="mean"),
    _reading("ours", "extent of a node by its angle", extent="angle"),
    _reading("ours", "extent of a node by its solid angle", extent="solid_angle"),
    _reading("ours", "second layer upsampled by 2", upsampling=2),
    _reading("ours", "second layer upsampled by 4", upsampling=4),
    _reading("ours", "second layer upsampled by 8", upsampling=8),
    _reading("ours", "second layer not upsampled", upsampling=1),
    _reading("ours", "upsampled by the mean guides of a pixel", guides="pixel"),
    _reading("ours", "upsampled by the guides of every sub-pixel", guides="subpixel"),
    _reading("q2-tree", "lights at the energy centroid", position="centroid"),
    _reading("q2-tree", "lights at the middle", position="centre"),
    _reading("q2-tree", "lights jittered", position="jitter"),
    _reading("structured", "solid angle counts up to 0.01 sr", useful_solid_angle=0.01),
    _reading("structured", "all solid angle counts", useful_solid_angle=None),
    _reading("structured", "deviation over texels", deviation="texels"),
    _reading("structured", "deviation over solid angle", deviation="solid angle"),
    _reading("structured", "lights at the energy centroid", position="centroid"),
    _reading("structured", "lights at the sample", position="sample"),
    _reading("tmms", "photographic tone mapping", tone="photographic"),
    _reading("tmms", "logarithmic tone mapping", tone="log"),
    _reading("tmms", "spatial bandwidth 0.3", spatial_bandwidth=0.3),
    _reading("tmms", "spatial bandwidth 0.15", spatial_bandwidth=0.15),
    _reading("tmms", "spatial bandwidth 0.4", spatial_bandwidth=0.4),
    _reading("tmms", "range bandwidth 6.5", range_bandwidth=6.5),
    _reading("tmms", "range bandwidth 3", range_bandwidth=3.0),
    _reading("tmms", "modes within 0.1 bandwidths", mode_reach=0.1),
    _reading("tmms", "modes within 0.5 bandwidths", mode_reach=0.5),
    _reading("tmms", "modes within 0.5 of half the spatial bandwidth", mode_reach=0.5,
             spatial_bandwidth=0.15),
    _reading("tmms", "split above 2 times the average", split_ratio=2.0),
    _reading("tmms", "split above the average", split_ratio=1.0),
    _reading("tmms", "split above 4 times the average", split_ratio=4.0),
    _reading("tmms", "all solid angle counts", useful_solid_angle=None),
    _reading("tmms", "solid angle counts up to 0.01 sr", useful_solid_angle=0.01),
    _reading("tmms", "no region wider than 2.5 caps", widest=2.5),
    _reading("tmms", "no region wider than 4 caps", widest=4.0),
    _reading("tmms", "regions of any shape", widest=None),
    _reading("variance-minimization", "distances in pixels", metric="planar"),
    _reading("variance-minimization", "distances on the sphere", metric="spherical"),
    _reading("variance-minimization", "the region of largest variance is cut", order="heap"),
    _reading("variance-minimization", "all regions are cut once a round", order="rounds"),
    *(
        _reading(sampler, choice, sets=sets)
        for sampler in PERTURBED
        if sampler != "fhis"  # whose own way stands above
        for choice, sets in (
            ("one set, perturbed", "perturbed"),
            ("eight independent sets", "independent"),
        )
    ),
    *(
        _reading(sampler, f"perturbed by the {extent} angle", light_extent=extent)
        for sampler in PERTURBED
        for extent in get_args(LightExtent)
    ),
)  # fmt: skip
"""Readings with words of their own; other parameters say theirs in their samplers' files."""

PRINTED = "its paper prints the value"
SAME_SAMPLES = "the samples are the same"
RATIO_ALONE = "only the ratios of the three weights matter"
HALVES = "half of the samples are the table's"
AS_SHIPPED = "the renderer's own, as it ships"
ELSEWHERE = "measured by the experiment `renderers`"

NOT_OPEN: dict[tuple[str, str], str] = {
    **{
        (name, "compensation"): ELSEWHERE
        for name in ("cycles", "falcor", "luxcore", "mitsuba-3", "pbrt-v4")
    },
    ("cycles", "least_width"): AS_SHIPPED,
    ("falcor", "side"): AS_SHIPPED,
    ("kd-tree", "blocks"): PRINTED,
    ("mis", "guided"): SAME_SAMPLES,
    ("mis-compensated", "guided"): SAME_SAMPLES,
    ("mis-compensated", "share"): HALVES,
    ("ours", "variance_weight"): RATIO_ALONE,
    ("q2-tree", "power"): PRINTED,
}  # fmt: skip
"""Parameters that are no open choice, by sampler and name: why not."""
SAME_AS = {"ours-no-upsampling": "ours"}
"""Samplers whose parameters are another's, which is measured for both."""
READ_AS = {"mis-compensated": ("mis", "compensation for BRDF sampling")}
"""Samplers that are a reading of another one: which, and the choice in words."""


RULED_OUT = {
    **{
        f"{sampler}[light_extent={extent}]": "one extent for all samplers"
        for sampler in PERTURBED
        for extent in get_args(LightExtent)
        if extent != LIGHT_EXTENT
    },
    **dict.fromkeys(
        (
            f"{sampler}[sets={'shifted' if sampler == 'fhis' else 'independent'}]"
            for sampler in PERTURBED
        ),
        "no sampler has sets of its own where its rivals are perturbed",
    ),
    "fhis[correct=False]": "its paper moves the points by the correction vectors",
    "kd-tree[selection=range]": "its paper prefers the squared error",
    "kd-tree[selection=variance]": "its paper prefers the squared error",
    "kd-tree[pdf_form=walk]": "its paper draws the block's number by the fitted law; a walk down "
    "the tree is what the fit replaces",
    "median-cut[aspect=False]": "its paper scales a region's width by the cosine of its latitude",
    "mis-compensated": "a sampler of its own; its paper is later than what `mis` stands for",
    "ours[extent_weight=0.0, energy_weight=0.0]": "its paper replaces it by the modified cut",
    "ours[kmeans=False]": "its paper moves the lights by k-means",
    "ours[masking=False]": "its paper masks the neighbourhood of a draw",
    "ours[searches=5]": "its paper has one search; more of them take time",
    "ours[upsampling=1]": "its paper upsamples; this is the sampler `ours-no-upsampling`",
    "restir[candidates=32]": "more candidates for the same rays, and more time",
    "restir[frames=8]": "images of eight frames, for the cost of eight",
    "restir[weights=biased]": "it loses light; its paper has an unbiased form",
    **{
        f"{sampler}[candidates={number}]": "more candidates for the same rays, and more time"
        for sampler in ("ris", "ris-stratified")
        for number in (16, 32)
    },
    "variance-minimization[metric=spherical]": "the published rule measures in pixels",
}
"""Readings that cannot be the default however small their error: why, by label."""


COSTLY = {
    "center-surround": ("spacing", "extent", "inner_in", "surface", "brightest_by"),
    **dict.fromkeys(PERTURBED, ("sets",)),
    "kd-tree": ("pdf_form",),
    "ours": ("sets", "upsampling", "guides"),
    "product": ("brdf_samples",),
    "restir": ("candidates", "neighbours", "weights", "visibility", "frames"),
    "ris": ("candidates",),
    "ris-stratified": ("candidates",),
}
"""Parameters that change what an image costs, by sampler: how many discs there are, too. They are
judged at equal cost: at equal lights a saving can only lose."""


@cache
def readings() -> tuple[Reading, ...]:
    """List every reading: those above, then what fields of other parameters say."""
    listed = {(one.sampler, name) for one in LISTED for name, _ in one.parameters}
    other = (
        (sampler, field)
        for sampler in sampler_names()
        if sampler not in SAME_AS
        for field in fields(sampler_class(sampler))
        if (sampler, field.name) not in listed and (sampler, field.name) not in NOT_OPEN
    )
    return LISTED + tuple(
        _reading(sampler, f"{field.name.replace('_', ' ')} {value}", **{field.name: value})
        for sampler, field in other
        for value in _values_of(sampler_class(sampler), field)
    )


def _values_of(sampler: type, field: Field) -> tuple[Any, ...]:
    """The values of a parameter that are read, its default among them; none where it is fixed."""
    if field.metadata.get("fixed"):
        return ()
    kind = get_type_hints(sampler)[field.name]
    if get_origin(kind) is Literal:
        return get_args(kind)
    read = (False, True) if kind is bool else tuple(field.metadata.get("readings", ()))
    return read if field.default in read or not read else (field.default, *read)


def changes_cost(label: str) -> bool:
    """Whether a reading sets a parameter that changes what an image costs."""
    spec = next((one.spec for one in readings() if one.spec.label == label), None)
    return spec is not None and any(
        name in COSTLY.get(spec.name, ()) for name, _ in spec.parameters
    )


def costly_samplers() -> tuple[SamplerSpec, ...]:
    """The readings that change what an image costs, with the defaults beside them."""
    return tuple(
        one
        for one in measured_samplers()
        if (one.name in COSTLY and not one.parameters) or changes_cost(one.label)
    )


def measured_samplers() -> tuple[SamplerSpec, ...]:
    """Every sampler with an open choice at its defaults, followed by its other readings."""
    specs: dict[str, list[SamplerSpec]] = {}
    for reading in readings():
        family = specs.setdefault(reading.sampler, [SamplerSpec(reading.sampler)])
        if reading.spec not in family:
            family.append(reading.spec)
    return tuple(spec for family in specs.values() for spec in family)


def choices_in_words() -> dict[str, str]:
    """The choices by the labels of their samplers, the defaults' by those they have when they are
    none: in older rows they may be so."""
    shown = {one.spec.label: one.choice for one in readings() if not one.is_default}
    return defaults_in_words() | shown | {label: choice for label, (_, choice) in READ_AS.items()}


def defaults_in_words() -> dict[str, str]:
    """Of the choices those that are the defaults now."""
    chosen = (one for one in readings() if one.is_default)
    return {SamplerSpec(one.sampler, one.parameters).label: one.choice for one in chosen}


def baselines() -> dict[str, str]:
    """The samplers that are a reading of another one, and which."""
    return {label: sampler for label, (sampler, _) in READ_AS.items()}
