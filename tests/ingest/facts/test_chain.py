from __future__ import annotations

import hashlib
import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ingest.errors import LedgerError
from ingest.facts.chain import Tree, canonical, digest, entry

# Entries and roots of the reference implementation of RFC 6962 (google/certificate-transparency, merkle_tree_test).
ENTRIES = ["", "00", "10", "2021", "3031", "40414243", "5051525354555657", "606162636465666768696a6b6c6d6e6f"]
ROOTS = [
    "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855",
    "6e340b9cffb37a989ca544e6bb780a2c78901d3fb33738768511a30617afa01d",
    "fac54203e7cc696cf0dfcb42c92a1d9dbaf70ad9e621f4bd8d98662f00e3c125",
    "aeb6bcfe274b70a14fb067a5e5578264db0fa9b51af5e0ba159158f329e06e77",
    "d37ee418976dd95753c1c73862b9398fa2a2cf9b4ff0fdfe8b30cd95209614b7",
    "4e3bbb1f7b478dcfe71fb631631519a3bca12c9aefca1612bfce4c13a86264d4",
    "76e67dadbcdf1e10e1b74ddc608abd2f98dfb16fbce75277b5232a127f2087ef",
    "ddb89be403809e325750d3d263cd78929c2942b7942a34b77e122c9594a74c8c",
    "5dc9da79a70659a9ad559cb701ded9a2ab9d823aad2f4960cfe370eff4604328",
]

json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=10,
)


def by_definition(entries: list[bytes]) -> bytes:
    """The Merkle tree hash as RFC 6962 section 2.1 defines it, by recursion."""
    if not entries:
        return hashlib.sha256(b"").digest()
    if len(entries) == 1:
        return hashlib.sha256(b"\x00" + entries[0]).digest()
    half = 1
    while half * 2 < len(entries):
        half *= 2
    return hashlib.sha256(b"\x01" + by_definition(entries[:half]) + by_definition(entries[half:])).digest()


def test_roots_are_those_of_the_reference_implementation() -> None:
    tree = Tree()
    roots = [tree.root]
    for text in ENTRIES:
        tree.add(bytes.fromhex(text))
        roots.append(tree.root)
    assert roots == ROOTS


@given(st.lists(st.binary(max_size=4), max_size=40))
def test_the_growing_tree_gives_the_root_of_the_definition(entries: list[bytes]) -> None:
    tree = Tree()
    for one in entries:
        tree.add(one)
    assert tree.root == by_definition(entries).hex()


@given(json_values)
def test_canonical_json_comes_back_equal_and_has_one_form(value: Any) -> None:
    once = canonical(value)
    assert json.loads(once) == value
    assert canonical(json.loads(once)) == once


def test_keys_are_sorted_and_nothing_is_escaped_or_rounded() -> None:
    value = {"é": 0.1, "b": 2**63, "a": {"z": None, "y": [True, -0.0]}}
    assert canonical(value) == '{"a":{"y":[true,-0.0],"z":null},"b":9223372036854775808,"é":0.1}'.encode()


@pytest.mark.parametrize("value", [float("nan"), float("inf"), b"bytes", {1: 2, "a": 3}, "\ud800"])
def test_what_json_cannot_hold_is_refused_in_one_line(value: Any) -> None:
    with pytest.raises(LedgerError, match=r"^a fact cannot be stored as JSON \(.+\): leave that value out") as caught:
        canonical({"x": value})
    assert "\n" not in str(caught.value)


def test_the_digest_changes_with_every_column_and_with_where_one_ends() -> None:
    digests = {
        digest("file-a", 1, "whyhot:X", b"{}"),
        digest("file-b", 1, "whyhot:X", b"{}"),
        digest("file-a", 2, "whyhot:X", b"{}"),
        digest("file-a", 1, "whyhot:Y", b"{}"),
        digest("file-a", 1, "whyhot:X", b"{ }"),
        digest("file-a", 1, "whyhot:X{}", b""),
    }
    assert len(digests) == 6


def test_no_two_rows_give_the_same_entry() -> None:
    assert entry(1, "a", 1, "t", b"x") != entry(1, "a", 1, "tx", b"")
    assert entry(1, "a,1", 1, "t", b"x") != entry(1, "a", 11, "t", b"x")
    assert entry(1, "a", 1, "t", b"x") != entry(2, "a", 1, "t", b"x")
