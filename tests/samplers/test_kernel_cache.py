"""Kept machine code follows all that it was made of, and is never used where it is damaged."""

import importlib.util
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
from numba.core.typing.templates import builtin_registry

from samplers import kernel_cache

KERNEL = """
    import numba
    import beside
    from beside import LIMIT, called, shape

    @numba.njit(cache=True, fastmath=False)
    def kernel(x):
        return called(x) + beside.OFFSET + LIMIT + shape(x)

    @numba.njit(cache=True)
    def other(x):
        return 2.0 * x
"""
BESIDE = """
    import numba
    from numba.extending import overload

    LIMIT, OFFSET, FACTOR, UNUSED = 1.0, 2.0, 3.0, 4.0

    def scaled_by(factor):
        @numba.njit
        def scaled(x):
            return factor * x
        return scaled

    scaled = scaled_by(5.0)

    @numba.njit
    def called(x):
        return scaled(x) * FACTOR

    def shape(x):
        raise NotImplementedError

    @overload(shape)
    def _shape(x):
        return lambda x: 7.0
"""


def _write(folder, **texts):
    """Modules, as old as if they had stood there for long."""
    for name, text in texts.items():
        file = folder / f"{name}.py"
        file.write_text(textwrap.dedent(text), encoding="utf-8")
        os.utime(file, (kernel_cache._STARTED - 1e4,) * 2)


def _depends(folder, monkeypatch, name="kernel"):
    """What a kernel of `user.py` depends on, the files being read anew."""
    kernel_cache._content_hash.cache_clear()  # it goes by the time of the edit
    for module in ("beside", "user"):
        spec = importlib.util.spec_from_file_location(module, folder / f"{module}.py")
        monkeypatch.setitem(sys.modules, module, importlib.util.module_from_spec(spec))
        code = compile((folder / f"{module}.py").read_text(), folder / f"{module}.py", "exec")
        exec(code, vars(sys.modules[module]))  # no byte code of an earlier text
    return kernel_cache.dependencies(getattr(sys.modules["user"], name).py_func)


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("user", "called(x) +", "called(x) -"),
        ("user", "cache=True)", "cache=True, error_model='numpy')"),
        ("beside", "LIMIT, OFFSET, FACTOR, UNUSED = 1.0", "LIMIT, OFFSET, FACTOR, UNUSED = 1.5"),
        ("beside", "= 1.0, 2.0", "= 1.0, 2.5"),
        ("beside", "2.0, 3.0", "2.0, 3.5"),
        ("beside", "scaled_by(5.0)", "scaled_by(5.5)"),
        ("beside", "factor * x", "factor - x"),
        ("beside", "7.0", "7.5"),
        ("beside", "@numba.njit\ndef called", "@numba.njit(fastmath=True)\ndef called"),
    ],
)
def test_whatever_a_kernel_is_made_of_counts(tmp_path, monkeypatch, file, old, new):
    texts = {"user": textwrap.dedent(KERNEL), "beside": textwrap.dedent(BESIDE)}
    _write(tmp_path, **texts)
    before = _depends(tmp_path, monkeypatch)
    assert _depends(tmp_path, monkeypatch) == before
    assert old in texts[file]
    _write(tmp_path, **{file: texts[file].replace(old, new)})
    assert _depends(tmp_path, monkeypatch) != before


@pytest.mark.parametrize("old", ["1.0", "2.0", "3.0"])
def test_what_another_file_registers_for_a_thing_counts(tmp_path, monkeypatch, old):
    beside = """
        import statistics
        import numpy as np
        from numba import types
        from numba.extending import overload, overload_method

        overload(statistics.mean, strict=False)(lambda x: lambda x: 1.0)
        overload(np.hypot)(lambda x: lambda x: 2.0)
        overload_method(types.Array, "doubled")(lambda x: lambda x: 3.0)
    """
    kernel = """
        import statistics
        import numba
        import numpy as np

        @numba.njit
        def kernel(x):
            return statistics.mean(x) + np.hypot(x) + x.doubled()
    """
    found = set()
    for text in (beside, beside.replace(old, "4.0")):
        monkeypatch.setattr(builtin_registry, "globals", [])
        monkeypatch.setattr(builtin_registry, "attributes", [])
        kernel_cache._registered.cache_clear()
        _write(tmp_path, user=kernel, beside=text)
        found.add(_depends(tmp_path, monkeypatch))
    kernel_cache._registered.cache_clear()
    assert len(found) == 2


def test_a_kernel_does_not_depend_on_files_of_which_it_names_nothing(tmp_path, monkeypatch):
    _write(tmp_path, user=KERNEL, beside=BESIDE)
    before = _depends(tmp_path, monkeypatch, "other")
    _write(tmp_path, beside=BESIDE.replace("5.0", "6.0"))
    assert _depends(tmp_path, monkeypatch, "other") == before


def test_swapped_functions_of_one_name_are_told_apart(tmp_path, monkeypatch):
    text = BESIDE + "\n    first, second = scaled_by(1.0), scaled_by(2.0)\n"
    kernel = """
        import numba
        from beside import first, second

        @numba.njit
        def kernel(x):
            return first(x) - second(second(x))
    """
    found = set()
    for names in ("first, second", "second, first"):
        _write(tmp_path, user=kernel, beside=text.replace("first, second", names))
        found.add(_depends(tmp_path, monkeypatch))
    assert len(found) == 2


def test_a_constant_that_is_replaced_in_the_process_counts(tmp_path, monkeypatch):
    _write(tmp_path, user=KERNEL, beside=BESIDE)
    before = _depends(tmp_path, monkeypatch)
    monkeypatch.setattr(sys.modules["beside"], "FACTOR", 9.0)
    assert kernel_cache.dependencies(sys.modules["user"].kernel.py_func) != before


def test_what_was_edited_since_the_process_began_is_not_kept(tmp_path, monkeypatch):
    _write(tmp_path, user=KERNEL, beside=BESIDE)
    (tmp_path / "beside.py").touch()
    os.utime(tmp_path / "beside.py", (kernel_cache._STARTED + 10.0,) * 2)
    with pytest.raises(kernel_cache.Unknown):
        _depends(tmp_path, monkeypatch)


def test_every_kernel_of_the_project_can_be_kept():
    from numba.core.dispatcher import Dispatcher

    import metrics.registry
    import renderer.render  # noqa: F401
    from samplers import sampler_names

    metrics.registry.metrics()
    sampler_names()
    own = [module for name, module in sys.modules.items() if name.partition(".")[0] in OWN]
    things = [value for module in own for value in vars(module).values()]
    kernels = {value for value in things if isinstance(value, Dispatcher)}
    assert len(kernels) > 50
    assert len({kernel_cache.dependencies(kernel.py_func) for kernel in kernels}) == len(kernels)


OWN = {"samplers", "renderer", "metrics"}
RUN = """
    import samplers, user
    print(user.kernel(1.0), sum(user.kernel.stats.cache_hits.values()))
"""
LIMITED = """
    import resource
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
"""
VALUE, HIT = 3.0 * 5.0 + 2.0 + 1.0 + 7.0, "1"


@pytest.fixture
def started(tmp_path):
    """What a new process prints of the kernel's value and its hits, and its other output."""
    _write(tmp_path, user=KERNEL, beside=BESIDE)

    def run(before=""):
        places = f"{tmp_path}{os.pathsep}{Path.cwd()}"
        done = subprocess.run(
            [sys.executable, "-B", "-c", textwrap.dedent(before) + textwrap.dedent(RUN)],
            env={**os.environ, "PYTHONPATH": places, "NUMBA_CACHE_DIR": str(tmp_path / "cache")},
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        return done.stdout.split(), done.stderr

    return run


def test_a_kernel_is_kept_and_compiled_anew_where_it_is_edited_or_damaged(started, tmp_path):
    assert started() == ([str(VALUE), "0"], "")
    assert started() == ([str(VALUE), HIT], "")
    (kept,) = (tmp_path / "cache" / "kernels").glob("kernel-*.kernel")
    whole = kept.read_bytes()
    garbled = bytearray(whole)
    garbled[len(whole) // 2] ^= 1
    foreign = b"not what Numba made"
    said = f"{kept.parent}: damaged kernels are there"
    for content, sentence in (
        (whole[:-100], said),
        (bytes(garbled), said),
        (kernel_cache._checksum(foreign) + foreign, f"{kept.parent}: kernels there cannot be used"),
    ):
        kept.write_bytes(content)
        values, told = started()
        assert values == [str(VALUE), "0"]
        assert sentence in told and told.count("\n") == 1
    assert started() == ([str(VALUE), HIT], "")
    _write(tmp_path, beside=BESIDE.replace("factor * x", "2.0 * factor * x"))
    assert started() == ([str(VALUE + 3.0 * 5.0), "0"], "")


def test_without_room_kernels_are_compiled_and_that_is_told(started, tmp_path):
    pytest.importorskip("resource")
    values, told = started(LIMITED)
    assert values == [str(VALUE), "0"]
    assert "compiled kernels cannot be kept" in told and told.count("\n") == 1
    assert not list((tmp_path / "cache" / "kernels").glob("kernel-*.kernel"))


def test_without_a_folder_that_can_be_written_nothing_is_kept_and_that_is_told(
    tmp_path, monkeypatch, capsys
):
    (tmp_path / "file").touch()
    monkeypatch.setattr(kernel_cache, "places", lambda: [tmp_path / "file" / "kernels"])
    kernel_cache.folder.cache_clear()
    try:
        assert kernel_cache.folder() is None
    finally:
        kernel_cache.folder.cache_clear()
    assert "kernels cannot be kept there; set NUMBA_CACHE_DIR" in capsys.readouterr().err


def test_what_was_not_used_for_longest_makes_room(tmp_path, monkeypatch):
    monkeypatch.setattr(kernel_cache, "MOST_BYTES", 250)
    for age in range(5):
        file = tmp_path / f"{age}{kernel_cache.SUFFIX}"
        file.write_bytes(bytes(100))
        os.utime(file, (1e9 - age,) * 2)
    kernel_cache._make_room(tmp_path)
    assert sorted(file.stem for file in tmp_path.iterdir()) == ["0", "1"]
