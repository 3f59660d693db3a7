"""No test asks another machine for anything: `conftest.py` lets no socket of Python reach one."""

from __future__ import annotations

import socket

import pytest

FAR = ("192.0.2.1", 9)  # of the addresses that are kept for texts


@pytest.mark.parametrize("host", ["example.com", FAR[0]])
def test_another_machine_is_out_of_reach(host: str) -> None:
    with pytest.raises(RuntimeError, match=f"asks the network for {host}"):
        socket.create_connection((host, FAR[1]), timeout=1)
    with socket.socket() as one, pytest.raises(RuntimeError, match="asks the network"):
        one.connect(FAR)


def test_a_server_on_this_one_is_within_reach() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server, socket.create_connection(server.getsockname()) as one:
        assert one.getpeername() == server.getsockname()
