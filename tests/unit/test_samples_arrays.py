"""The samples' arrays, molecular dynamics, store and command line, and whether bakes repeat."""

import subprocess
import sys

import numpy as np
import pytest

import meniscus
from meniscus.addon.fluid.errors import InputError, OutputError
from meniscus.samples import argon, block, ethane, jets, lennard_jones, molecule, peptide, scattered, shell, store


def distances_to_all(positions, box=np.inf):
    separations = positions[:, None] - positions
    if np.isfinite(box):
        separations -= box * np.rint(separations / box)
    return np.sqrt(np.sum(separations**2, axis=-1))


@pytest.fixture
def empty_store(tmp_path, monkeypatch):
    monkeypatch.setattr(store, "FOLDER", tmp_path)
    return tmp_path


@pytest.mark.parametrize("sample", [block, jets, scattered])
def test_the_same_seed_gives_the_same_balls_and_another_seed_others(sample):
    first, again, other = sample.balls(500, seed=3), sample.balls(500, seed=3), sample.balls(500, seed=4)
    assert np.array_equal(first.positions, again.positions)
    assert np.array_equal(first.radii, again.radii)
    assert not np.array_equal(first.positions, other.positions)


@pytest.mark.parametrize("sample", [block, jets, scattered])
@pytest.mark.parametrize("count", [1, 27, 28, 1000, 12345])
def test_a_sample_has_as_many_balls_as_were_asked_for(sample, count):
    balls = sample.balls(count)
    assert len(balls) == count
    assert not balls.dropped
    assert np.array_equal(balls.ids, np.arange(count))


def test_two_percent_of_a_block_are_droplets_that_touch_neither_it_nor_its_influence():
    balls = block.balls(5000)
    reach = np.abs(balls.positions).max(axis=1)
    inside = reach <= block.SIDE / 2
    assert np.count_nonzero(~inside) == 100
    assert reach[~inside].min() >= block.SIDE / 2 + balls.radii[0] * (1 - 1e-6)


@pytest.mark.slow
def test_a_block_is_dense_and_its_radius_is_two_spacings():
    balls = block.balls(5000)
    spacing = balls.radii[0] / 2
    bulk = balls.positions[np.abs(balls.positions).max(axis=1) <= block.SIDE / 2]
    assert len(bulk) * spacing**3 == pytest.approx(block.SIDE**3, rel=0.1)
    distances = distances_to_all(bulk)
    np.fill_diagonal(distances, np.inf)
    # Neighbours on the lattice come as close as the jitter lets them, and none is missing.
    assert 0.5 * spacing <= distances.min()
    assert distances.min(axis=1).max() < 1.25 * spacing


def test_scattered_balls_fill_the_cube_and_the_range_of_radii():
    balls = scattered.balls(4000)
    assert np.abs(balls.positions).max() <= scattered.SIDE / 2
    assert np.allclose(balls.positions.mean(axis=0), 0, atol=0.05)
    spacing = scattered.SIDE / 4000 ** (1 / 3)
    assert np.quantile(balls.radii / spacing, [0, 0.5, 1]) == pytest.approx([0.4, 0.8, 1.2], abs=0.02)


def test_particles_of_the_jets_are_born_and_stay_from_the_full_frame_on():
    counts = [len(jets.balls(3000, frame=frame)) for frame in (1, 10, 20, jets.FULL_FRAME, 3 * jets.FULL_FRAME)]
    assert counts[0] == 0
    assert 0 < counts[1] < counts[2] < 3000
    assert counts[3:] == [3000, 3000]


def test_particles_of_the_jets_fly_along_parabolas():
    before, after = (jets.balls(5000, frame=frame) for frame in (70, 71))
    step = 1 / jets.FRAMES_PER_SECOND
    # All but those that hit the basin in between: they have not been slowed down by gravity alone.
    flew = np.isclose(after.velocities[:, 2], before.velocities[:, 2] - jets.GRAVITY * step, atol=1e-4)
    assert flew.mean() > 0.9
    mean = (before.velocities + after.velocities)[flew].astype(np.float64) / 2
    assert np.allclose(after.positions[flew], before.positions[flew] + mean * step, atol=1e-5)
    assert before.positions[:, 2].min() > -1e-6
    assert before.positions[:, 2].max() == pytest.approx(6.2**2 / (2 * jets.GRAVITY), rel=0.15)


def test_an_alpha_helix_has_its_pitch_its_hydrogen_bonds_and_turns_right():
    n, ca, c, o, cb = peptide.helix(20).swapaxes(0, 1)
    turn = np.unwrap(np.arctan2(ca[:, 1], ca[:, 0]))
    assert np.degrees(np.diff(turn)) == pytest.approx(100, abs=1)
    assert np.diff(ca[:, 2]) == pytest.approx(1.5, abs=0.1)
    assert np.linalg.norm(ca[:, :2], axis=1) == pytest.approx(2.3, abs=0.05)
    assert np.linalg.norm(n[1:] - c[:-1], axis=1) == pytest.approx(1.329)
    # From each oxygen to the nitrogen four residues on.
    assert np.linalg.norm(o[:-4] - n[4:], axis=1) == pytest.approx(2.9, abs=0.25)
    # Amino acids of life are left-handed.
    assert np.all(np.einsum("ij,ij->i", np.cross(n - ca, c - ca), cb - ca) > 0)


@pytest.mark.parametrize("residue", peptide.SIDE_CHAINS)
def test_all_rotamers_of_a_residue_have_its_bonds(residue):
    backbone = peptide.helix(4)[1]
    rotamers = peptide.side_chains(residue, backbone)
    bonds = peptide.SIDE_CHAINS[residue]
    assert rotamers.shape == (9, len(bonds), 3)
    names = [*peptide.BACKBONE, *(bond.atom for bond in bonds)]
    atoms = np.concatenate([np.broadcast_to(backbone, (9, 5, 3)), rotamers], axis=1)
    for bond in bonds:
        length = np.linalg.norm(atoms[:, names.index(bond.atom)] - atoms[:, names.index(bond.along[2])], axis=1)
        assert length == pytest.approx(bond.length)
    # Nothing but what is bonded is near, and a ring's two ends meet.
    apart = np.stack([distances_to_all(positions) for positions in atoms])
    assert apart[:, ~np.eye(len(names), dtype=bool)].min(initial=9) > 1.2
    if residue in ("PHE", "TYR"):
        assert apart[:, names.index("CZ"), names.index("CE2")] == pytest.approx(1.38, abs=0.02)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_molecule_has_its_atoms_bonds_and_elements(seed):
    protein = molecule.protein(seed)
    assert len(protein.positions) == molecule.ATOMS == 2878
    assert len(np.unique(protein.residues)) == molecule.HELICES * molecule.RESIDUES
    distances = distances_to_all(protein.positions)
    np.fill_diagonal(distances, np.inf)
    # A bond or more for each atom, and few places where side chains are too near each other.
    assert distances.min(axis=1).max() < 1.85
    strangers = np.abs(protein.residues[:, None] - protein.residues) > 1
    assert np.count_nonzero(distances[strangers] < 2.5) / 2 < 0.02 * molecule.ATOMS
    shares = {element: np.mean(protein.elements == element) for element in "CNOS"}
    assert shares["C"] == pytest.approx(0.65, abs=0.05)
    assert 0 < shares["S"] < 0.02


def test_atoms_are_as_large_and_coloured_as_their_elements():
    balls, protein = molecule.balls(), molecule.protein()
    assert len(balls) == molecule.ATOMS
    for element, radius in molecule.RADII.items():
        is_element = protein.elements == element
        assert np.allclose(balls.radii[is_element], molecule.RADIUS * radius * molecule.UNIT)
        assert np.allclose(balls.colors[is_element], molecule.COLORS[element])
    # Where two carbons are bonded the surface is one piece, and would not be for spheres.
    field = meniscus.Field("wyvill", molecule.ISOVALUE)
    pair = meniscus.Balls([[0, 0, 0], [1.53 * molecule.UNIT, 0, 0]], molecule.RADIUS * 1.7 * molecule.UNIT)
    assert 2 * field.kernel_radii(pair.radii, pair.weights)[0] < 1.53 * molecule.UNIT
    half_way = np.array([[1.53 / 2 * molecule.UNIT, -1.0, 0.0]])
    t, _ = meniscus.oracle.cast(pair, field, half_way, np.array([[0.0, 1.0, 0.0]]))
    assert np.isfinite(t[0])


def test_the_cell_list_finds_the_pairs_that_comparing_all_atoms_finds():
    box = 12.0
    positions = np.random.default_rng(5).uniform(0, box, (400, 3))
    first, second = lennard_jones.neighbour_pairs(positions, box, 2.9)
    close = distances_to_all(positions, box) < 2.9
    expected = {(i, j) for i, j in zip(*np.nonzero(close), strict=True) if i < j}
    found = [tuple(sorted(pair)) for pair in zip(first.tolist(), second.tolist(), strict=True)]
    assert len(found) == len(set(found))
    assert set(found) == expected


def test_a_box_too_narrow_for_the_cell_list_is_refused():
    with pytest.raises(InputError, match="three times"):
        lennard_jones.neighbour_pairs(np.zeros((2, 3)), 8.0, 2.9)


def test_two_atoms_attract_beyond_the_potentials_minimum_and_repel_within():
    def force_at(distance):
        positions = np.array([[0.0, 0, 0], [distance, 0, 0]])
        return lennard_jones.forces(positions, 12.0, (np.array([0]), np.array([1])))

    assert force_at(2 ** (1 / 6)) == pytest.approx(np.zeros((2, 3)), abs=1e-12)
    # The derivative of 4 (r^-12 - r^-6), by hand.
    assert force_at(1.0)[0] == pytest.approx([-24.0, 0, 0])
    assert force_at(1.5)[0, 0] == pytest.approx(-24 * (2 * 1.5**-13 - 1.5**-7))
    assert force_at(2.6) == pytest.approx(np.zeros((2, 3)))


def test_energy_and_momentum_are_kept_without_a_thermostat():
    gas = lennard_jones.hot_gas(300, 0.1, 1.2, np.random.default_rng(2))
    simulation = lennard_jones.Simulation(gas)

    def energy():
        return simulation.potential_energy() + 0.5 * np.sum(gas.velocities**2)

    for _ in range(50):
        simulation.step()
    before = energy()
    for _ in range(400):
        simulation.step()
    assert energy() == pytest.approx(before, rel=5e-4)
    assert gas.velocities.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-9)


def test_the_thermostat_reaches_its_temperature():
    gas = lennard_jones.hot_gas(300, 0.05, 1.5, np.random.default_rng(2))
    simulation = lennard_jones.Simulation(gas)
    for _ in range(300):
        simulation.step(0.7)
    assert gas.temperature == pytest.approx(0.7, rel=0.03)


@pytest.fixture
def short_argon(empty_store, monkeypatch):
    monkeypatch.setattr(argon, "FRAMES", 6)
    monkeypatch.setattr(argon, "COOLED_FRAME", 2)


def test_argon_condenses(short_argon):
    def clustered_share(frame):
        positions = argon.balls(600, seed=1, frame=frame).positions / argon.SIGMA
        box = (600 / argon.DENSITY) ** (1 / 3)
        distances = distances_to_all(positions, box)
        return np.mean(np.count_nonzero(distances < 1.5, axis=1) > 3)

    # A gas that stays hot has one or two atoms in a hundred that are near three others by chance.
    assert clustered_share(1) == 0
    assert clustered_share(6) > 0.05


def test_argon_is_the_same_for_the_same_seed_also_when_it_is_computed_anew(short_argon, tmp_path):
    first = argon.balls(400, seed=1, frame=4)
    (stored,) = tmp_path.iterdir()
    stored.unlink()
    again, other = argon.balls(400, seed=1, frame=4), argon.balls(400, seed=2, frame=4)
    assert np.array_equal(first.positions, again.positions)
    assert np.array_equal(first.velocities, again.velocities)
    assert not np.array_equal(first.positions, other.positions)


@pytest.mark.parametrize("frame", [0, 7])
def test_argon_refuses_a_frame_that_it_has_not(short_argon, frame):
    with pytest.raises(InputError, match="from 1 to 6"):
        argon.balls(400, frame=frame)


def test_molecules_of_ethane_are_rigid_and_keep_their_energy():
    simulation = ethane.Dumbbells(ethane.droplets_in_vapour(300, np.random.default_rng(2)))
    simulation.keep_bonds()
    for _ in range(60):
        simulation.step(ethane.TEMPERATURE)

    def energy():
        return simulation.potential_energy() + 0.5 * np.sum(simulation.gas.velocities**2)

    before = energy()
    for _ in range(60):
        simulation.step()
    assert abs(energy() - before) < 2e-3 * abs(before)
    bonds = simulation.gas.positions[1::2] - simulation.gas.positions[::2]
    bonds -= simulation.gas.box * np.rint(bonds / simulation.gas.box)
    np.testing.assert_allclose(np.linalg.norm(bonds, axis=1), ethane.BOND, rtol=1e-9)


def test_ethane_is_droplets_in_vapour(empty_store, monkeypatch):
    monkeypatch.setattr(ethane, "STEPS", 30)
    sites = ethane.balls(1000)
    near = np.count_nonzero(distances_to_all(sites.positions / ethane.SIGMA) < 2 * ethane.RADIUS, axis=1) - 1
    assert near.max() > 50
    assert np.count_nonzero(near == 1) > 10, "a lone molecule has two sites"
    with pytest.raises(InputError, match="even number of sites"):
        ethane.balls(1001)


def test_a_file_is_made_once_for_each_set_of_parameters(empty_store):
    made = []

    def make(path):
        made.append(path)
        path.write_text("whole")

    first = store.stored_file("thing", ".txt", {"seed": 1}, make)
    assert store.stored_file("thing", ".txt", {"seed": 1}, make) == first
    assert len(made) == 1
    assert store.stored_file("thing", ".txt", {"seed": 2}, make) != first
    assert first.read_text() == "whole"
    assert first.name.startswith("thing_")


def test_a_file_that_failed_is_not_taken_for_whole(empty_store):
    def fail(path):
        path.write_text("half")
        raise OutputError("no more")

    with pytest.raises(OutputError, match="no more"):
        store.stored_file("thing", ".txt", {}, fail)
    assert list(empty_store.iterdir()) == []


@pytest.mark.parametrize("value", ["0", "-3", "2.5", "many"])
def test_an_unusable_number_on_the_command_line_is_named(capsys, value):
    with pytest.raises(SystemExit) as stop:
        shell.save_sample(block.build, ["--output", "x.blend", f"--count={value}"])
    assert stop.value.code == 2
    assert f"'{value}' is no whole number greater than 0" in capsys.readouterr().err


@pytest.mark.slow
def test_a_bake_of_many_particles_is_the_same_in_every_process():
    bake = (
        "import sys, hashlib, numpy\n"
        "from meniscus.samples import dam_break, scene_parts\n"
        "from meniscus.samples.one_thread import bpy\n"
        "scene = scene_parts.new_scene()\n"
        "liquid = dam_break.build(scene, spacing=0.12, frame_end=12)\n"
        "scene.frame_set(12)\n"
        "particles = liquid.evaluated_get(bpy.context.evaluated_depsgraph_get()).particle_systems[0].particles\n"
        "positions = numpy.empty(3 * len(particles), numpy.float32)\n"
        "particles.foreach_get('location', positions)\n"
        "assert len(particles) > 1000\n"
        "print('positions', hashlib.sha256(positions.tobytes()).hexdigest())\n"
    )

    def positions_hash():
        run = subprocess.run([sys.executable, "-c", bake], capture_output=True, text=True, check=True, timeout=300)
        return [line for line in run.stdout.splitlines() if line.startswith("positions")]

    first = positions_hash()
    assert len(first) == 1
    assert positions_hash() == first
