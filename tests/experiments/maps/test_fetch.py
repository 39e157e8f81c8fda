"""Downloads end whole or not at all, whatever the server and the connection do."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

from experiments.maps.fetch import LARGEST_LISTING, FetchRequest, Patience, fetch
from experiments.maps.poly_haven import FOLDER_VARIABLE, SUITES
from samplers import EnvlightError
from tests.experiments.poly_haven_server import serving

SIZE = 300_001
CONTENT = np.random.default_rng(5).bytes(SIZE)
FILE = "/file/lapa"
PATIENCE = Patience(attempts=4, backoff=0.001, timeout=20.0)
HASTY = replace(PATIENCE, timeout=0.25)
"""For a server that falls silent for four times as long."""


@pytest.fixture
def server():
    with serving({"lapa": CONTENT, "red_wall": CONTENT[::-1]}) as running:
        yield running


@pytest.fixture
def get(server, tmp_path):
    """Fetch maps into tmp_path."""

    def command(*names, patience=PATIENCE, **options):
        names = list(names or ["lapa"])
        fetch(FetchRequest(names, folder=tmp_path, api=server.api, patience=patience, **options))

    return command


def part(folder):
    return folder / "lapa_1k.exr.part"


def is_there(folder):
    """The file is there, whole, and alone but for the empty lock."""
    names = {file.name for file in folder.iterdir()}
    whole = (folder / "lapa_1k.exr").read_bytes() == CONTENT
    return whole and names == {"lapa_1k.exr", ".fetch.lock"}


def test_maps_arrive_and_are_not_fetched_again(server, get, tmp_path, capsys):
    get("lapa", "red_wall", "lapa")
    assert (tmp_path / "lapa_1k.exr").read_bytes() == CONTENT
    assert (tmp_path / "red_wall_1k.exr").read_bytes() == CONTENT[::-1]
    assert "2 maps downloaded (0.6 MB), 0 were there already" in capsys.readouterr().out
    get("lapa", "red_wall")
    assert "0 maps downloaded (0.0 MB), 2 were there already" in capsys.readouterr().out
    assert server.ranges("lapa") == server.ranges("red_wall") == [""]
    assert all(agent.startswith("envlight/") for agent in server.agents)


@pytest.mark.parametrize(
    "faults",
    [["cut"], ["cut", "cut", "cut", "cut", "cut"], ["stalls"], ["silence"], [500, 503, 429],
     ["redirect"], ["cut", "redirect"], ["cut", "ignores ranges"], ["cut", "wrong range"],
     ["cut", 416], ["damaged"], ["too long"], ["too short", "too short"],
     ["cut", "damaged", "cut"]],
    ids=str,
)  # fmt: skip
def test_faults_that_pass_are_overcome(server, get, tmp_path, faults):
    server.faults[FILE] = list(faults)
    get(patience=HASTY if {"stalls", "silence"} & set(faults) else PATIENCE)
    assert is_there(tmp_path)
    assert not server.faults[FILE]


def test_a_cut_download_goes_on_where_it_was(server, get, tmp_path):
    server.faults[FILE] = ["cut"]
    get()
    assert server.ranges("lapa") == ["", f"bytes={SIZE // 2}-"]


def test_a_complete_part_needs_no_download(server, get, tmp_path):
    part(tmp_path).write_bytes(CONTENT)
    get()
    assert server.ranges("lapa") == []
    assert is_there(tmp_path)


@pytest.mark.parametrize("left", [b"other" * 100, CONTENT + b"more", CONTENT[:-1] + b"?"])
def test_a_part_of_something_else_is_thrown_away(server, get, tmp_path, left):
    part(tmp_path).write_bytes(left)
    get()
    assert server.ranges("lapa")[-1] == ""
    assert is_there(tmp_path)


def test_a_damaged_file_is_replaced(server, get, tmp_path, capsys):
    (tmp_path / "lapa_1k.exr").write_bytes(b"?" + CONTENT[1:])
    get()
    assert "not the file that is offered; it is replaced" in capsys.readouterr().out
    assert is_there(tmp_path)


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        (500, "status 500 .4 attempts in a row.; try later, the same command goes on"),
        ("silence", "no answer in time"),
        ("damaged", "the MD5 instead of the 300001 bytes of MD5 .* listed"),
        ("too long", "300002 bytes instead of the 300001"),
        ("too short", "only 300000 of 300001 bytes came"),
        (403, "the server answers with status 403"),
        (404, "not there, though listed"),
        ("redirect without end", "it is redirected without end"),
    ],
)
def test_faults_that_stay_end_in_a_sentence_and_no_file(server, get, tmp_path, fault, sentence):
    server.faults[FILE] = [fault] * 40
    with pytest.raises(EnvlightError, match=sentence):
        get(patience=HASTY if fault == "silence" else PATIENCE)
    assert not (tmp_path / "lapa_1k.exr").exists()
    server.faults.clear()
    get()
    assert is_there(tmp_path)


def test_a_wrong_id_ends_it_before_anything_is_downloaded(server, get, tmp_path):
    with pytest.raises(EnvlightError, match="Poly Haven has no map called 'lappa'"):
        get("lapa", "lappa")
    assert server.ranges("lapa") == []


@pytest.mark.parametrize(
    ("names", "options", "sentence"),
    [
        (["../lapa"], {}, "'../lapa' is no map's id"),
        (["lapa"], {"resolution": "3k"}, "there is no '3k'; write 1k, 2k"),
        (["lapa"], {"format": "png"}, "there is no 'png'; write exr, hdr"),
        (["lapa"], {"resolution": "2k"}, "'lapa' is not there as 2k .exr; there are 1k, 2k"),
        (["lapa"], {"resolution": "8k"}, "'lapa' is not there as 8k .exr; there are 1k, 2k"),
    ],
)
def test_what_cannot_be_had_is_said(get, names, options, sentence):
    with pytest.raises(EnvlightError, match=sentence):
        get(*names, **options)


@pytest.mark.parametrize(
    "listed", [{"url": None}, {"size": "many"}, {"size": 0}, {"md5": "none"}, {"md5": None}]
)
def test_a_listing_that_lacks_something_is_refused(server, get, listed):
    server.listed["lapa"] = listed
    with pytest.raises(EnvlightError, match="no address, size and MD5 of the map"):
        get()


@pytest.mark.parametrize("fault", ["no list", "nested"])
def test_an_answer_that_is_no_listing_is_refused(server, get, fault):
    server.faults["/files/lapa"] = [fault]
    with pytest.raises(EnvlightError, match="the answer is no list of files"):
        get()


def test_a_listing_without_end_is_not_taken_whole(server, get):
    server.listed["lapa"] = {"more": "x" * LARGEST_LISTING}
    with pytest.raises(EnvlightError, match="longer than the 4,194,304 bytes that a list of files"):
        get()


def test_a_file_for_which_there_is_no_room_is_refused_before_it_comes(server, get):
    server.listed["lapa"] = {"size": 10**18}
    with pytest.raises(EnvlightError, match=r"1000000000\.0 GB are to come and .* GB are free"):
        get()
    assert server.ranges("lapa") == []


def test_the_api_is_asked_again_too(server, get, tmp_path):
    server.faults["/files/lapa"] = [500, "silence", "redirect"]
    get(patience=HASTY)
    assert is_there(tmp_path)


def test_no_server_and_no_address_are_said(tmp_path):
    for api, sentence in (("http://127.0.0.1:9", "no connection"), ("nowhere", "check the addr")):
        with pytest.raises(EnvlightError, match=sentence):
            fetch(FetchRequest(["lapa"], folder=tmp_path, api=api, patience=PATIENCE))


def test_a_folder_that_cannot_be_made_is_said(server, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(EnvlightError, match=r"cannot be written .*; give another folder by --to"):
        fetch(FetchRequest(["lapa"], folder=tmp_path / "file" / "maps", api=server.api))


def test_a_full_disk_is_said(get, monkeypatch, tmp_path):
    def full(file):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(EnvlightError, match=r"No space left on device.; make room"):
        get()
    assert not (tmp_path / "lapa_1k.exr").exists()


COMMAND = [sys.executable, "-m", "experiments.cli.main", "fetch", "lapa"]


def test_a_killed_download_goes_on_where_it_was(server, tmp_path):
    server.pause = 0.02
    environment = os.environ | {FOLDER_VARIABLE: str(tmp_path), "ENVLIGHT_POLY_HAVEN": server.api}
    child = subprocess.Popen(COMMAND, env=environment)
    while not part(tmp_path).exists() or not part(tmp_path).stat().st_size:
        assert child.poll() is None
        time.sleep(0.001)
    child.send_signal(signal.SIGKILL)
    child.wait()
    there = part(tmp_path).stat().st_size
    assert 0 < there < SIZE
    assert not (tmp_path / "lapa_1k.exr").exists()
    done = subprocess.run(COMMAND, env=environment, capture_output=True, text=True, check=True)
    assert "1 maps downloaded" in done.stdout
    assert server.ranges("lapa") == ["", f"bytes={there}-"]
    assert is_there(tmp_path)


def test_two_at_a_time_do_not_share_a_folder(server, get, tmp_path):
    server.pause = 0.05
    options = ["--to", str(tmp_path), "--api", server.api]
    with subprocess.Popen(COMMAND + options) as child:
        while not part(tmp_path).exists():
            assert child.poll() is None
            time.sleep(0.001)
        with pytest.raises(EnvlightError, match="in use by another fetch"):
            get()
    assert child.returncode == 0
    assert is_there(tmp_path)


def test_the_command_line_says_what_is_wrong(server, envlight, tmp_path):
    status, _, told = envlight("fetch", "nope", "--api", server.api, "--to", tmp_path)
    assert status == 2
    assert told.startswith("envlight: fetch: Poly Haven has no map called")


def test_a_suite_that_was_fetched_is_found(tmp_path, monkeypatch):
    from experiments.maps.sources import find_environments

    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    suite = "paper-named-12"
    with serving({name: name.encode() for name in SUITES[suite]}) as running:
        fetch(FetchRequest([suite], api=running.api, patience=PATIENCE))
    names = [source.name for source in find_environments(suite, [], 16)]
    assert names == list(SUITES[suite])
