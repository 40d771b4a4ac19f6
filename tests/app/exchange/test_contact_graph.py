"""The contacts of a frame as a networkx graph and as a GraphML file."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.exchange.contact_graph import make_graph, write_graphs

networkx = pytest.importorskip("networkx")


@pytest.mark.thorough
def test_the_file_contains_the_same_graph(with_a_loss, tmp_path):
    files = write_graphs(with_a_loss, tmp_path)
    assert len(files) == len(with_a_loss.frames)
    for frame in (1, 2):
        read, made = networkx.read_graphml(files[frame]), make_graph(with_a_loss, frame)
        assert dict(read.nodes(data=True)) == dict(made.nodes(data=True))
        assert {frozenset(pair): data for *pair, data in read.edges(data=True)} == {
            frozenset(pair): data for *pair, data in made.edges(data=True)
        }


def test_edges_have_the_forces_of_their_pairs(results):
    graph, forces = make_graph(results, 2), results.frames[2]
    assert graph.number_of_nodes() == results.grains.count + results.walls.count
    assert graph.number_of_edges() == forces.contacts.count
    names = [*map(str, results.tracks.id.tolist()), *results.walls.name]
    for c in range(forces.contacts.count):
        edge = graph.edges[names[forces.contacts.i[c]], names[forces.contacts.j[c]]]
        assert edge["fn"] == forces.fn[c]
    degree = np.array([graph.degree[name] for name in names[: results.grains.count]])
    both = np.concatenate([forces.contacts.i, forces.contacts.j])
    assert degree.tolist() == np.bincount(both, minlength=len(names))[: results.grains.count].tolist()


def test_a_lost_grain_has_no_position(with_a_loss):
    graph = make_graph(with_a_loss, 2)
    assert "x" not in graph.nodes[str(with_a_loss.tracks.id[3])]
    assert graph.graph["units"]["fn"] == "N"
