"""Says which of the project's packages a file of the same name hides, as beside a user's script."""

import warnings
from importlib.util import find_spec
from pathlib import Path

PACKAGES = ("renderer", "metrics", "experiments")
_home = Path(__file__).parents[1]

for _name in PACKAGES:
    _found = find_spec(_name)
    if _found and _found.origin and not Path(_found.origin).is_relative_to(_home):
        warnings.warn(
            f"{_found.origin} hides envlight's package '{_name}'; rename it to import that one",
            stacklevel=2,
        )
