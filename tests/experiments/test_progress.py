"""What takes long is told: a sentence now and then in a log, a line that moves on a terminal."""

import os
import sys
import time

import pytest

from experiments import progress
from experiments.progress import telling

EVERY = 0.01


@pytest.fixture
def often(monkeypatch):
    for name in ("SOON_SECONDS", "SAID_SECONDS"):
        monkeypatch.setattr(progress, name, EVERY)


def until(heard, sentence):
    """Wait until it was told."""
    end = time.monotonic() + 20.0
    text = ""
    while sentence not in text:
        assert time.monotonic() < end, text
        time.sleep(EVERY)
        text += heard()


def test_a_log_hears_how_far_it_is_and_of_the_innermost(often, capsys):
    def heard():
        return capsys.readouterr().err

    with telling("measuring", 32) as told:
        told.advance()
        until(heard, "envlight: measuring, 1 of 32, 0 s\n")
        with telling("compiling"):
            until(heard, "envlight: compiling, ")
        told.working_on("reference of vase · noon")
        until(heard, "envlight: reference of vase · noon, 1 of 32")
    with telling("downloading", 2_000_000, in_bytes=True):
        until(heard, "downloading, 0 of 2 MB")


def test_what_is_short_says_nothing_and_an_error_ends_it(capsys):
    with pytest.raises(ZeroDivisionError), telling("measuring"):
        raise ZeroDivisionError
    with telling("measuring again"):
        pass
    assert capsys.readouterr() == ("", "")


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="a system without terminals of this kind")
def test_a_terminal_has_a_line_that_moves(monkeypatch):
    ours, theirs = os.openpty()
    with os.fdopen(theirs, "w") as terminal:
        monkeypatch.setattr(sys, "stderr", terminal)
        monkeypatch.setenv("TERM", "xterm")
        monkeypatch.setattr(progress, "SHORT_SECONDS", 0.0)
        with telling("measuring [a]", 32):
            until(lambda: os.read(ours, 1 << 12).decode(), "measuring [a], 0 of 32")
    os.close(ours)
