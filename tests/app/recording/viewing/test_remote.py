"""A run on another machine, watched through ssh; the other machine is a network namespace."""

from __future__ import annotations

import os
import re
import shutil
import socket
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import pytest
from playwright.sync_api import Page
from rodsight.synthetic.synthesis import SynthesisSettings, synthesize

from tests.browser import open_when_served, wait_for_forces
from tests.program import RODSIGHT

pytestmark = [pytest.mark.slow, pytest.mark.screen]  # more than a minute: two networks, a page drawn through ssh

HERE, THERE, SSH_PORT = "10.231.87.1", "10.231.87.2", 2222
CONNECTED = "connected"  # output of the tunnel when it is open


@dataclass(frozen=True)
class Machine:
    """The other machine: its namespace, and the key for ssh."""

    name: str
    key: Path

    def start(self, *command: object, **options) -> subprocess.Popen:
        return subprocess.Popen(["ip", "netns", "exec", self.name, *map(str, command)], **options)

    def tunnel(self, *ports: int) -> list[str]:
        forwards = [part for port in ports for part in ("-L", f"{port}:localhost:{port}")]
        options = (
            "StrictHostKeyChecking=no", "UserKnownHostsFile=/dev/null", "ExitOnForwardFailure=yes", "BatchMode=yes",
            "PermitLocalCommand=yes", f"LocalCommand=echo {CONNECTED}",
        )  # fmt: skip
        arguments = [part for option in options for part in ("-o", option)]
        return ["ssh", "-N", "-p", str(SSH_PORT), "-i", str(self.key), *arguments, *forwards, f"root@{THERE}"]


def ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True, capture_output=True, text=True)


@pytest.fixture
def machine(tmp_path: Path) -> Iterator[Machine]:
    for tool in ("ip", "ssh", "ssh-keygen"):
        if shutil.which(tool) is None:
            pytest.skip(f"no {tool}: apt-get install iproute2 openssh-client")
    sshd = shutil.which("sshd") or "/usr/sbin/sshd"
    if not Path(sshd).exists():
        pytest.skip("no sshd: apt-get install openssh-server")
    if os.geteuid() != 0:
        pytest.skip("network namespaces need root")
    name, ours, theirs = f"rodsight{os.getpid()}", f"rs{os.getpid()}h", f"rs{os.getpid()}t"
    with ExitStack() as stack:
        try:
            ip("netns", "add", name)
        except subprocess.CalledProcessError as error:
            pytest.skip(f"no network namespace: {error.stderr.strip()}")
        stack.callback(ip, "netns", "delete", name)
        ip("link", "add", ours, "type", "veth", "peer", "name", theirs)
        stack.callback(ip, "link", "delete", ours)
        ip("link", "set", theirs, "netns", name)
        ip("address", "add", f"{HERE}/30", "dev", ours)
        ip("link", "set", ours, "up")
        for arguments in (
            ("address", "add", f"{THERE}/30", "dev", theirs),
            ("link", "set", theirs, "up"),
            ("link", "set", "lo", "up"),
        ):
            ip("netns", "exec", name, "ip", *arguments)
        made = Machine(name, make_key(tmp_path / "user_key"))
        run = Path("/run/sshd")  # the chroot directory of sshd
        if not run.exists():
            run.mkdir(mode=0o755)
            stack.callback(shutil.rmtree, run)
        server = made.start(sshd, "-D", "-e", "-f", sshd_config(tmp_path), stderr=subprocess.PIPE, text=True)
        stack.callback(end, server)
        wait_for_output(server.stderr, "Server listening on")
        yield made


def make_key(file: Path) -> Path:
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(file)], check=True)
    return file


def sshd_config(folder: Path) -> Path:
    make_key(folder / "host_key")
    file = folder / "sshd_config"
    file.write_text(
        f"Port {SSH_PORT}\nListenAddress {THERE}\nHostKey {folder / 'host_key'}\nPidFile {folder / 'sshd.pid'}\n"
        f"AuthorizedKeysFile {folder / 'user_key.pub'}\nStrictModes no\nUsePAM no\nPasswordAuthentication no\n"
        "PermitRootLogin prohibit-password\nAllowTcpForwarding local\n"
    )
    return file


def reaches(host: str, port: int) -> bool:
    try:
        socket.create_connection((host, port), timeout=2).close()
    except OSError:
        return False
    return True


def wait_for_output(lines: IO[str] | None, part: str) -> None:
    """Read the output of a process up to a line that contains a text."""
    assert lines is not None
    output = []
    for line in lines:
        output.append(line)
        if part in line:
            return
    pytest.fail(f"the process ended with the output {output}")


def end(process: subprocess.Popen) -> None:
    process.terminate()
    try:
        process.wait(20)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    for pipe in (process.stdout, process.stderr):
        if pipe is not None:
            pipe.close()


@contextmanager
def running(process: subprocess.Popen) -> Iterator[subprocess.Popen]:
    try:
        yield process
    finally:
        end(process)


def test_a_run_on_another_machine_is_watched_through_ssh_only(machine: Machine, tmp_path: Path, page: Page):
    experiment = tmp_path / "far"
    synthesize(experiment, SynthesisSettings(grains=120, frames=12, photographs=False, noise=1e-5, seed=1))
    command = [*RODSIGHT, "run", experiment, "--view", "web", "--out", tmp_path / "out"]
    command += ["--set", "solver.sweeps=60000"]  # long enough to be watched
    with running(machine.start(*command, stdout=subprocess.PIPE, text=True)) as run:
        assert run.stdout is not None
        line = run.stdout.readline()
        found = re.search(r"Watch it at (\S+) .*-L (\d+):localhost:\2 ", line)
        assert found, line
        address, ports = found[1], (int(found[2]),)
        for port in ports:
            if reaches("127.0.0.1", port):
                pytest.skip(f"port {port} of this machine, which the tunnel needs, is in use")
            assert not reaches(THERE, port)  # not served to the network
        with running(subprocess.Popen(machine.tunnel(*ports), stdout=subprocess.PIPE, text=True)) as tunnel:
            wait_for_output(tunnel.stdout, CONNECTED)
            open_when_served(page, f"{address}&renderer=webgl")
            assert tunnel.poll() is None
            wait_for_forces(page)
        assert run.poll() is None  # still being solved
    # The servers end with the terminated run.
    left = subprocess.run(["ip", "netns", "pids", machine.name], capture_output=True, text=True, check=True).stdout
    names = {Path(f"/proc/{pid}/comm").read_text().strip() for pid in left.split()}
    assert names == {"sshd"}
