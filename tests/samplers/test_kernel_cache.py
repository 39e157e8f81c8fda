"""Where compiled kernels are kept: old states go, recent ones stay however many there are."""

import os
import time

import numba.core.config
import pytest

from samplers import kernel_cache


@pytest.fixture
def home(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(numba.core.config, "CACHE_DIR", numba.core.config.CACHE_DIR)
    monkeypatch.setattr(kernel_cache.platformdirs, "user_cache_path", lambda name: tmp_path / name)
    return tmp_path / "envlight" / "kernels"


def _add(home, name, age):
    folder = home / name
    folder.mkdir(parents=True)
    os.utime(folder, (time.time() - age,) * 2)
    return folder


def test_states_that_a_running_process_may_use_stay(home):
    recent = [_add(home, f"recent{k}", 60.0 * k) for k in range(2 * kernel_cache.KEPT)]
    kernel_cache.choose_folder()
    assert all(folder.is_dir() for folder in recent)


def test_only_the_newest_of_old_states_stay(home):
    age = 2.0 * kernel_cache.KEPT_SECONDS
    old = [_add(home, f"old{k}", age + k) for k in range(2 * kernel_cache.KEPT)]
    kernel_cache.choose_folder()
    left = [folder for folder in old if folder.is_dir()]
    assert left == old[: kernel_cache.KEPT - 1]  # and the folder of this state
