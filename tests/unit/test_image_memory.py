"""Memory of images that is used again."""

import numpy as np

import meniscus
from meniscus.addon.render.image_memory import ImageMemory
from meniscus.addon.render.renderer import render

SHAPE = (6, 8)


def place(image):
    return image.__array_interface__["data"][0]


def test_memory_is_used_again_when_the_last_view_is_gone():
    memory = ImageMemory()
    first = memory.empty((*SHAPE, 4), np.float32)
    first[:] = 1
    at = place(first)
    channel = first[1:, :, 3].reshape(-1)[::2]
    shown = memoryview(first[2:3])
    del first
    assert place(memory.empty((*SHAPE, 4), np.float32)) != at
    del channel
    other = memory.empty((*SHAPE, 4), np.float32)
    assert place(other) != at
    shown.release()
    again = memory.empty((*SHAPE, 4), np.float32)
    assert place(again) == at
    assert again.flags.writeable
    # Of another type, but of this size.
    del again
    assert place(memory.empty((*SHAPE, 4), np.int32)) == at


def test_images_of_another_size_leave_nothing_behind():
    memory = ImageMemory()
    held, dropped = memory.empty(SHAPE, np.float32), memory.empty(SHAPE, np.float32)
    del dropped
    assert [len(spare) for spare in memory._spare.values()] == [1]
    memory.empty((8, 6), np.float32)
    del held
    assert [len(spare) for spare in memory._spare.values()] == [1]
    assert memory.empty(SHAPE, np.bool_).shape == SHAPE


def test_an_image_that_is_held_stays_as_it_is():
    memory, field = ImageMemory(), meniscus.Field()
    camera = meniscus.Camera.perspective((0, -5, 0), (0, 0, 0), fov_y=0.6, width=25, height=19)
    passes = ("combined", "depth", "position", "ball_id", "object_index")

    def image(x, memory):
        return render(meniscus.Balls([(x, 0, 0)], 1.0), camera, field, backend="cpu", passes=passes, memory=memory)

    held = image(-0.5, memory)
    for x in (0.5, 0.2):
        image(x, memory)
    for name in passes:
        np.testing.assert_array_equal(held[name], image(-0.5, None)[name], err_msg=name)
    assert not np.array_equal(held["depth"], image(0.5, None)["depth"])
