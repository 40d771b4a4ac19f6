"""`rodsight view --web` prints its address, serves it in the foreground, and ends when interrupted."""

import signal
import subprocess
import sys
import urllib.request

import pytest

from tests.app.recording.fake_results import make_results


@pytest.mark.slow
def test_the_page_is_there_until_ctrl_c_and_a_second_call_takes_another_port(tmp_path):
    from rodsight.recording.files.finished_run import write_recording

    (tmp_path / "run").mkdir()
    write_recording(make_results(1, 4, 4, sweeps=2), tmp_path / "run" / "recording.rrd")
    call = [sys.executable, "-c", "from rodsight.cli.main import main; main()", "view", str(tmp_path / "run"), "--web"]
    running = [subprocess.Popen(call, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    try:
        addresses = []
        for each in running:
            assert each.stdout is not None
            printed = each.stdout.readline()
            assert "Ctrl+C" in printed
            addresses.append(printed.split()[1])
            assert each.poll() is None
            browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())  # the address gives a cookie
            with browser.open(addresses[-1], timeout=30) as page:
                assert b"<html" in page.read()
        assert len({address.split("/")[2] for address in addresses}) == 2
    finally:
        for each in running:
            each.send_signal(signal.SIGINT)
        for each in running:
            each.communicate(timeout=30)  # closes what it printed through
    assert [each.returncode for each in running] == [0, 0]
