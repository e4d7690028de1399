"""Wiring of the frame graph, without a driver: faults are named, all at once."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from skincli.gpu.blocks import Values
from skincli.graph.frame_graph import FrameGraph
from skincli.graph.node import ONE, Draw, Input, Output, Pass, Ref


@dataclass(frozen=True)
class Nothing(Values):
    pass


class Copy(Pass):
    """Copies its image."""

    shader = "passes/slope.frag"
    inputs = {"image": Input()}
    outputs = {"copied": Output()}


def copy(name: str, *source: Ref) -> Copy:
    return Copy(name, (4, 4), [Draw(Nothing())], {"image": source[0]} if source else {"image": ONE})


def test_all_faults_of_the_wiring_are_reported_together() -> None:
    with pytest.raises(ValueError, match="two nodes") as caught:
        FrameGraph([copy("a"), copy("a"), copy("b", Ref("c", "copied")), copy("d", Ref("a", "painted"))])
    assert str(caught.value) == (
        "two nodes are called 'a'; 'b' reads 'c.copied', which no node writes; "
        "'d' reads 'a.painted', which no node writes"
    )


def test_a_cycle_names_its_nodes() -> None:
    graph = FrameGraph([copy("a", Ref("b", "copied")), copy("b", Ref("a", "copied"))])
    with pytest.raises(ValueError, match="a cycle of nodes: a <- b <- a"):
        graph.run([Ref("a", "copied")])


def test_keys_depend_on_values_source_and_inputs_and_on_nothing_else() -> None:
    def key(graph: FrameGraph, name: str) -> str:
        graph._compile((Ref(name, "copied"),))
        graph._make_keys()
        return graph._keys[Ref(name, "copied")]

    plain = key(FrameGraph([copy("a"), copy("b", Ref("a", "copied"))]), "b")
    assert plain == key(FrameGraph([copy("a"), copy("x"), copy("b", Ref("a", "copied"))]), "b")
    renamed = key(FrameGraph([copy("other"), copy("b", Ref("other", "copied"))]), "b")
    assert plain == renamed
    larger = Copy("a", (8, 8), [Draw(Nothing())], {"image": ONE})
    assert plain != key(FrameGraph([larger, copy("b", Ref("a", "copied"))]), "b")
