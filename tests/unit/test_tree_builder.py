"""Trees for a sequence of frames."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest

import meniscus
from meniscus.addon.fluid.errors import CancelledError, InputError
from meniscus.addon.render import tree_builder
from meniscus.addon.render.tree_builder import TreeBuilder

FIELD = meniscus.Field()
SECONDS = 20.0


def some_balls(seed):
    return meniscus.Balls(np.random.default_rng(seed).random((50, 3)), 0.2)


def watch(_):
    pass


@pytest.fixture
def gate(monkeypatch):
    """Trees wait until the gate opens; `begun` holds the balls of those that were begun, `given_up` of those cancelled."""

    class Gate:
        opens = threading.Event()
        begun: list[meniscus.Balls] = []
        given_up: list[meniscus.Balls] = []

    gate, build = Gate(), tree_builder.FittedBvh

    def wait_and_build(balls, field, **options):
        gate.begun.append(balls)
        while not gate.opens.wait(0.005):
            try:
                options["watch"](0.0)
            except CancelledError:
                gate.given_up.append(balls)
                raise
        return build(balls, field, **options)

    gate.begun, gate.given_up = [], []
    monkeypatch.setattr(tree_builder, "FittedBvh", wait_and_build)
    yield gate
    gate.opens.set()


def wait_for(condition):
    end = time.monotonic() + SECONDS
    while not condition() and time.monotonic() < end:
        time.sleep(0.002)
    assert condition()


def in_background(action):
    """A thread that does it, and what comes of it."""
    results = []
    thread = threading.Thread(target=lambda: results.append(action()), daemon=True)
    thread.start()
    return thread, results


def test_a_tree_is_that_of_the_native_core_and_stays():
    balls, builder = some_balls(1), TreeBuilder()
    tree = builder.tree(balls, FIELD, 0, watch)
    np.testing.assert_array_equal(tree.arrays.nodes, meniscus.FittedBvh(balls, FIELD).arrays().nodes)
    assert builder.tree(balls, meniscus.Field(), 0, watch) is tree
    assert builder.tree(balls, meniscus.Field(isovalue=0.3), 0, watch) is not tree
    builder.forget()
    assert builder.tree(balls, FIELD, 0, watch) is not tree


def test_the_next_tree_is_built_while_nobody_waits(gate):
    first, second = some_balls(1), some_balls(2)
    builder = TreeBuilder()
    gate.opens.set()
    builder.tree(first, FIELD, 0, watch)
    builder.expect(second, FIELD)
    tree = builder.tree(second, FIELD, 0, watch)
    assert gate.begun == [first, second]
    assert tree.balls is second


def test_newer_balls_end_a_tree_that_nobody_waits_for(gate):
    first, second = some_balls(1), some_balls(2)
    builder = TreeBuilder()
    builder.expect(first, FIELD)
    wait_for(lambda: gate.begun)
    builder.expect(second, FIELD)
    thread, results = in_background(lambda: builder.tree(second, FIELD, 0, watch))
    wait_for(lambda: len(gate.begun) == 2)
    assert gate.given_up == [first]
    gate.opens.set()
    thread.join(SECONDS)
    assert results[0].balls is second


def test_who_waits_gets_a_tree_whatever_is_expected_next(gate):
    first, second = some_balls(1), some_balls(2)
    builder = TreeBuilder()
    thread, results = in_background(lambda: builder.tree(first, FIELD, 0, watch))
    wait_for(lambda: gate.begun)
    builder.expect(second, FIELD)
    gate.opens.set()
    thread.join(SECONDS)
    assert results[0].balls is first
    assert builder.tree(second, FIELD, 0, watch).balls is second
    assert gate.given_up == []


def test_the_user_need_not_wait(gate):
    def give_up(_):
        raise CancelledError("The render was cancelled")

    balls, builder = some_balls(1), TreeBuilder()
    with pytest.raises(CancelledError, match="The render was cancelled"):
        builder.tree(balls, FIELD, 0, give_up)
    gate.opens.set()
    assert builder.tree(balls, FIELD, 0, watch).balls is balls


def test_what_goes_wrong_is_told_and_tried_again(monkeypatch):
    def fail(*_, **__):
        raise InputError("No tree today")

    balls, builder = some_balls(1), TreeBuilder()
    with monkeypatch.context() as patch:
        patch.setattr(tree_builder, "FittedBvh", fail)
        with pytest.raises(InputError, match="No tree today"):
            builder.tree(balls, FIELD, 0, watch)
    assert builder.tree(balls, FIELD, 0, watch).balls is balls
