"""Renders grids and meshes with Blender, without a display.

    blender --background --python samples/blender/view.py -- --output PICTURE.png OBJECT ...

Objects are placed in a row, in the given order:

    --surface FILE.vdb:GRID[@LEVEL]  a level set or a share of material, through Volume to Mesh; LEVEL defaults to 0
    --volume FILE.vdb:GRID           any grid of numbers or voxels, as a volume; values other than 0 scatter light
    --mesh FILE.ply|FILE.stl         a mesh, for example of mesh-export

One Blender unit is one millimetre. The camera is placed by the bounding boxes of the objects.
"""

import argparse
import math
import pathlib
import sys

import bpy
from mathutils import Matrix, Vector

PAINTS = ((0.60, 0.60, 0.57), (0.20, 0.42, 0.62), (0.78, 0.46, 0.20), (0.36, 0.55, 0.34))


class Placed(argparse.Action):
    """Keeps objects of all kinds in the order of the command line."""

    def __call__(self, parser, namespace, value, option=None):
        namespace.objects = [*(namespace.objects or []), (option.lstrip("-"), value)]


def arguments():
    parser = argparse.ArgumentParser(prog="view.py", description=__doc__.splitlines()[0])
    parser.add_argument("--output", required=True, help="the PNG to write")
    for kind, shape in (("surface", "FILE.vdb:GRID[@LEVEL]"), ("volume", "FILE.vdb:GRID"), ("mesh", "FILE")):
        parser.add_argument(f"--{kind}", action=Placed, dest="objects", metavar=shape)
    parser.add_argument("--labels", default="", help="labels in front of the objects, separated by commas")
    parser.add_argument("--width", type=int, default=900, help="pixels")
    parser.add_argument("--height", type=int, default=270, help="pixels")
    parser.add_argument("--samples", type=int, default=64, help="rays per pixel")
    parser.add_argument("--blend", help="also save the scene in this .blend file")
    given = parser.parse_args(sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else [])
    if not given.objects:
        parser.error("nothing to show: give --surface, --volume or --mesh")
    return given


def link(name, data):
    made = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(made)
    return made


def paint(colour, roughness=0.55):
    material = bpy.data.materials.new("paint")
    material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*colour, 1)
    shader.inputs["Roughness"].default_value = roughness
    return material


def smoke(grid, colour, size):
    """Returns a material that scatters light where `grid` is not 0, to a depth of a sixth of `size`."""
    material = bpy.data.materials.new("smoke")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    value = nodes.new("ShaderNodeAttribute")
    value.attribute_name = grid
    there = nodes.new("ShaderNodeMath")
    there.operation = "GREATER_THAN"
    there.inputs[1].default_value = 0
    density = nodes.new("ShaderNodeMath")
    density.operation = "MULTIPLY"
    density.inputs[1].default_value = 6 / size
    shader = nodes.new("ShaderNodeVolumePrincipled")
    shader.inputs["Color"].default_value = (*(0.5 + part / 2 for part in colour), 1)
    shader.inputs["Absorption Color"].default_value = (*colour, 1)
    links.new(value.outputs["Fac"], there.inputs[0])
    links.new(there.outputs[0], density.inputs[0])
    links.new(density.outputs[0], shader.inputs["Density"])
    links.new(shader.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs["Volume"])
    return material


def load_volume(text):
    """Returns the volume object of `FILE:GRID` and the grid of that name."""
    path, _, name = text.rpartition(":")
    volume = bpy.data.volumes.new(name)
    volume.filepath = str(pathlib.Path(path).resolve())
    if not path or not volume.grids.load():
        raise SystemExit(f"view.py: cannot read '{path}': {volume.grids.error_message or 'expected FILE.vdb:GRID'}")
    for grid in volume.grids:
        if grid.name == name:
            return link(name, volume), grid
    raise SystemExit(f"view.py: '{path}' has no grid '{name}'; it has {' '.join(grid.name for grid in volume.grids)}")


def half_voxel(grid):
    """Returns half a voxel: Blender takes the centre of a voxel in OpenVDB for its lower corner."""
    return Vector(grid.matrix_object[axis][axis] / 2 for axis in range(3))


def add_surface(text, colour):
    text, _, level = text.partition("@")
    source, grid = load_volume(text)
    shift = half_voxel(grid)
    made = link(source.name, bpy.data.meshes.new(source.name))
    modifier = made.modifiers.new("Volume to Mesh", "VOLUME_TO_MESH")
    modifier.object = source
    modifier.grid_name = grid.name
    modifier.threshold = float(level or 0)
    modifier.resolution_mode = "GRID"
    modifier.use_smooth_shade = True
    evaluated = made.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = bpy.data.meshes.new_from_object(evaluated)
    bpy.data.objects.remove(source)
    bpy.data.objects.remove(made)
    if not mesh.vertices:
        raise SystemExit(f"view.py: Blender finds no surface in grid '{grid.name}'; use --volume")
    mesh.transform(Matrix.Translation(-shift))
    mesh.materials.append(paint(colour))
    return link(mesh.name, mesh)


def add_volume(text, colour):
    made, grid = load_volume(text)
    bpy.context.view_layer.update()
    made.data.materials.append(smoke(grid.name, colour, max(made.dimensions)))
    made.location -= half_voxel(grid)
    return made


def add_mesh(path, colour):
    before = set(bpy.data.objects)
    importer = {".stl": bpy.ops.import_mesh.stl, ".ply": bpy.ops.import_mesh.ply}.get(pathlib.Path(path).suffix.lower())
    if importer is None or not pathlib.Path(path).is_file():
        raise SystemExit(f"view.py: '{path}' is not an .stl or .ply file")
    importer(filepath=str(pathlib.Path(path).resolve()))
    made, = set(bpy.data.objects) - before
    made.data.materials.clear()
    made.data.materials.append(paint(colour))
    return made


def corners(thing):
    return [thing.matrix_world @ Vector(corner) for corner in thing.bound_box]


def bounds(things):
    points = [point for thing in things for point in corners(thing)]
    return [Vector(pick(point[axis] for point in points) for axis in range(3)) for pick in (min, max)]


def in_a_row(things):
    """Places the objects side by side on the floor. Returns the largest edge."""
    bpy.context.view_layer.update()
    sizes = [bounds([thing]) for thing in things]
    edge = max(max(high - low) for low, high in sizes)
    x = 0
    for thing, (low, high) in zip(things, sizes):
        thing.location += Vector((x - low.x, -(low.y + high.y) / 2, -low.z))
        x += high.x - low.x + 0.2 * edge
    bpy.context.view_layer.update()
    return edge


def add_labels(things, labels, edge):
    texts = []
    for thing, label in zip(things, labels):
        low, high = bounds([thing])
        curve = bpy.data.curves.new("label", "FONT")
        curve.body = label.strip()
        curve.align_x = "CENTER"
        curve.size = 0.1 * edge
        made = link("label", curve)
        made.location = ((low.x + high.x) / 2, low.y - 0.22 * edge, 0.002 * edge)
        made.data.materials.append(paint((0.05, 0.05, 0.05), 1))
        texts.append(made)
    return texts


def add_sun(name, towards, strength, softness):
    data = bpy.data.lights.new(name, "SUN")
    data.energy = strength
    data.angle = math.radians(softness)
    link(name, data).rotation_euler = Vector(towards).to_track_quat("-Z", "Y").to_euler()


def add_stage(things, edge):
    """Adds floor, light and camera according to the bounding box of the objects."""
    low, high = bounds(things)
    middle = (low + high) / 2
    floor = bpy.data.meshes.new("floor")
    far = 200 * edge
    floor.from_pydata([(x * far, y * far, 0) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))], [], [(0, 1, 2, 3)])
    floor.materials.append(paint((0.62, 0.62, 0.64), 0.9))
    link("floor", floor)

    add_sun("key", (0.8, 0.7, -0.75), 2.6, 8)
    add_sun("rim", (-0.5, -1, -0.6), 0.7, 20)
    world = bpy.data.worlds.new("sky")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.85, 0.9, 1, 1)
    world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.5

    camera = link("camera", bpy.data.cameras.new("camera"))
    camera.data.lens = 85
    camera.data.clip_end = 10 * far
    camera.rotation_euler = (math.radians(64), 0, 0)
    scene = bpy.context.scene
    scene.world, scene.camera = world, camera
    bpy.context.view_layer.update()
    points = [value for thing in things for point in corners(thing) for value in point]
    camera.location, _ = camera.camera_fit_coords(bpy.context.evaluated_depsgraph_get(), points)
    # Leaves a margin of a twentieth.
    camera.location += camera.matrix_world.to_quaternion() @ Vector((0, 0, 0.05 * (camera.location - middle).length))


def main():
    given = arguments()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    for importer in ("io_mesh_stl", "io_mesh_ply"):
        bpy.ops.preferences.addon_enable(module=importer)
    scene = bpy.context.scene
    scene.unit_settings.scale_length = 0.001
    scene.unit_settings.length_unit = "MILLIMETERS"
    scene.render.engine = "CYCLES"
    scene.cycles.samples = given.samples
    scene.cycles.use_denoising = False
    scene.cycles.max_bounces = 4
    scene.cycles.volume_bounces = 4
    scene.cycles.sample_clamp_indirect = 4
    scene.render.resolution_x, scene.render.resolution_y = given.width, given.height
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform = "Standard"

    add = {"surface": add_surface, "volume": add_volume, "mesh": add_mesh}
    things = [add[kind](what, PAINTS[at % len(PAINTS)]) for at, (kind, what) in enumerate(given.objects)]
    edge = in_a_row(things)
    labels = add_labels(things, given.labels.split(",") if given.labels else [], edge)
    bpy.context.view_layer.update()
    add_stage([*things, *labels], edge)
    if given.blend:
        bpy.ops.wm.save_as_mainfile(filepath=str(pathlib.Path(given.blend).resolve()))
    scene.render.filepath = str(pathlib.Path(given.output).resolve())
    bpy.ops.render.render(write_still=True)


main()
