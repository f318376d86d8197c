# SPDX-License-Identifier: GPL-3.0-or-later
"""Worlds and margins from Python, beside a loop over all pairs."""
import numpy as np
import padder
import pytest


def scene(seed, worlds, n=300):
    random = np.random.default_rng(seed)
    world = random.integers(0, worlds + 1, n).astype(np.uint32)
    world[world == worlds] = padder.EVERY_WORLD
    return random.random((n, 3)) * 4, random.random(n) * 0.3, world


def brute(centers, radii, world, margin):
    gap = np.linalg.norm(centers[:, None] - centers[None], axis=2) - radii[:, None] - radii[None]
    meet = (world[:, None] == world) | (world[:, None] == padder.EVERY_WORLD) | (world == padder.EVERY_WORLD)
    i, j = np.nonzero(np.triu((gap <= margin) & meet, 1))
    return np.stack([i, j], 1), gap[i, j]


@pytest.mark.parametrize("seed", range(5))
def test_contacts_and_answers_are_those_of_all_pairs(seed):
    worlds, margin = 4, 0.02 * seed
    centers, radii, world = scene(seed, worlds)
    pairs, gaps = brute(centers, radii, world, margin)
    found = padder.detect(centers, radii, world=world, margin=margin)
    order = np.lexsort(found.pairs.T[::-1])
    assert np.array_equal(found.pairs[order], pairs)
    assert np.allclose(found.depth[order], -gaps, atol=1e-12)
    of_world = np.minimum(world[pairs[:, 0]], world[pairs[:, 1]])
    count = padder.worlds(worlds, "count", centers, radii, world=world, margin=margin).count
    distance = padder.worlds(worlds, "distance", centers, radii, world=world, margin=margin)
    some = padder.worlds(worlds, "any", centers, radii, world=world, margin=margin)
    assert len(some) == worlds and some.any.dtype == bool
    for w in range(worlds):
        mine = of_world == w
        assert count[w] == mine.sum() and some.any[w] == mine.any()
        assert np.isclose(distance.distance[w], gaps[mine].min())
        assert np.array_equal(distance.pair[w], pairs[mine][gaps[mine].argmin()])


def test_one_asset_in_many_worlds_meets_an_obstacle_of_all():
    shape = (np.zeros((1, 3)), 0.5)
    poses = np.tile(np.r_[np.eye(3).ravel(), 0, 0, 0], (101, 1))
    poses[:100, 9] = np.arange(100) * 0.05
    world = np.r_[np.arange(100), padder.EVERY_WORLD].astype(np.uint32)
    bodies = padder.Bodies([shape], poses, world=world)
    assert np.array_equal(bodies.world, world)
    detector = padder.Detector()
    some = detector.worlds(100, bodies=bodies).any.copy()
    assert np.array_equal(some, np.arange(100) * 0.05 <= 1)
    assert len(detector.detect(bodies=bodies)) == some.sum()


def test_one_number_is_the_world_of_all_spheres():
    centers = np.zeros((3, 3))
    assert padder.worlds(8, "count", centers, 1.0, world=7).count.tolist() == [0] * 7 + [3]


def test_what_was_not_asked_for_and_what_makes_no_sense_is_said():
    centers, radii, world = scene(1, 2)
    answers = padder.worlds(2, "any", centers, radii, world=world)
    with pytest.raises(AttributeError, match="answer"):
        answers.distance
    with pytest.raises(ValueError, match="answer must be"):
        padder.worlds(2, "all", centers, radii)
    body = padder.Bodies([(centers, radii)], np.r_[np.eye(3).ravel(), 0, 0, 0][None], world=[1])
    for outside in ({"centers": centers[:1], "radii": 1, "world": [1]}, {"centers": centers[:1], "radii": 1, "world": 1}, {"bodies": body}):
        with pytest.raises(IndexError, match="is in world 1, but"):
            padder.worlds(1, "any", **outside)
    assert len(padder.worlds(0, "any", centers, radii, world=padder.EVERY_WORLD)) == 0
    with pytest.raises(ValueError, match="world belong to loose spheres"):
        padder.detect(world=world)


def test_a_history_names_the_place_of_each_pair_in_the_list_before():
    random = np.random.default_rng(3)
    centers, radii = random.random((2000, 3)) * 8, 0.3
    detector = padder.Detector(backend="omp", history=True)
    before = {}
    for step in range(5):
        contacts = detector.detect(centers, radii)
        pairs, history = contacts.pairs.copy(), contacts.history.copy()
        assert history.dtype == np.uint32 and len(history) == len(contacts) > 0
        assert [before.get(tuple(p), padder.NO_CONTACT) for p in pairs.tolist()] == history.tolist()
        before = {tuple(p): k for k, p in enumerate(pairs.tolist())}
        centers = centers[: len(centers) - 10] + random.normal(0, 0.02, (len(centers) - 10, 3))
        del contacts
    with pytest.raises(AttributeError, match="history"):
        padder.detect(centers, radii).history
