"""The chains of digests.py: a line of bash for each name.

Outputs are called `out...`, so that no input is replaced. An input is in the chain's folder if the line names it.
"""

from digest_inputs import broken_meshes, whole_meshes

OPERATORS = ("compare csg dither hollow info interlace mask mask-spectrum material-assign measure mesh-export mesh2sdf normals "
             "offset read render resample simulate slice-export slice-import stats write").split()
COMMANDS = ("printers", "ssim")

MIMAKI = "--printer mimaki-3duj-553"
LATTICES = {"mimaki": MIMAKI, "j750-27um": "--printer stratasys-j750-27um", "j750-14um": "--printer stratasys-j750-14um",
            "cubes": "--pitch 50um,50um,50um", "own": "--printer own.json"}


def stages():
    """Chains whose outputs are the inputs of others, in order. The name of a chain is that of its output."""
    return {
        "surface.vdb": f"vdbdither mesh2sdf part.stl {MIMAKI} -o surface.vdb",
        "deep.vdb": f"vdbdither mesh2sdf part.stl {MIMAKI} --band 0.5mm -o deep.vdb",
        "normals.vdb": "vdbdither normals -i surface.vdb -o normals.vdb",
        "solid.vdb": "vdbdither dither -i normals.vdb -o solid.vdb --displaced",
        "printed.vdb": "vdbdither simulate -i solid.vdb -o printed.vdb",
        "slope-printed.vdb": f"vdbdither mesh2sdf slope.stl {MIMAKI} ! dither ! simulate -o slope-printed.vdb",
        "layered.vdb": "vdbdither material-assign -i solid.vdb --shell 0.2mm:cyan,0.2mm:white --core clear -o layered.vdb",
        "pair.vdb": f"vdbdither mesh2sdf lower.stl upper.stl {MIMAKI} ! dither -o pair.vdb",
        "second.vdb": f"vdbdither mesh2sdf ball.stl {MIMAKI} -o second.vdb",
        "second-deep.vdb": f"vdbdither mesh2sdf ball.stl {MIMAKI} --band 0.5mm -o second-deep.vdb",
        "cubes.vdb": "vdbdither mesh2sdf part.stl --pitch 60um,60um,60um -o cubes.vdb",
        "tile.vdb": "vdbdither mask --size 16,8,16 --sigma 1.1 -o tile.vdb",
        "stack.zip": "vdbdither slice-export -i layered.vdb stack.zip",
        "part-seen.png": "vdbdither render slope.stl part-seen.png --samples 4",
        "print-seen.png": "vdbdither render -i slope-printed.vdb print-seen.png --frame slope.stl --samples 4",
        "heights.exr": "vdbdither read solid.vdb --grids solid ! slice-export out --format exr --layers 30:31 && "
                       "mv out/slice_00030.exr heights.exr",
    }


def words():
    """Help, manuals, --explain and --verbose."""
    chains = {"help": "vdbdither --help && vdbdither help && vdbdither help all", "version": "vdbdither --version"}
    chains |= {f"help {name}": f"vdbdither {name} --help" for name in (*OPERATORS, *COMMANDS)}
    chains |= {f"docs {kind}": f"vdbdither docs {kind} out" for kind in ("markdown", "man", "completion")}
    fixed = "--memory 2GiB --threads 1 --explain | sed 's/^\\(disk .*\\) of .* for/\\1 for/'"
    main = "! normals ! dither ! material-assign ! slice-export out"
    chains |= {f"explain {name}": f"vdbdither mesh2sdf part.stl {lattice} {main} {fixed}" for name, lattice in LATTICES.items()}
    for name, chain in {
            "barrier": f"mesh2sdf part.stl {MIMAKI} -o out.vdb",
            "reaches": "read pair.vdb ! material-assign --shell 0.2mm:white --core clear ! simulate ! render out.png",
            "csg": "read surface.vdb ! csg --union second.vdb ! normals ! interlace ! stats",
            "offset": "read deep.vdb ! offset --map waves8.png --height 0.1mm ! hollow --thickness 0.1mm ! mesh-export out.stl",
            "resample": f"resample cubes.vdb {MIMAKI} ! dither --mask white ! measure --reference part.stl",
            "mask": "mask --size 32 ! mask-spectrum out.json",
            "mesh": "measure ball.stl --reference part.stl"}.items():
        chains[f"explain {name}"] = f"vdbdither {chain} {fixed}"
    chains["verbose"] = (f"vdbdither mesh2sdf part.stl {MIMAKI} {main} --verbose --threads 1 2>&1 | "
                         "sed -E 's/ +/ /g; s/[0-9.]+ (s|[MG]iB) /N \\1 /g; s/[0-9]+ Mvoxel/N Mvoxel/'")
    return chains


def refusals():
    """Wrong usage and bad data."""
    lines = {
        "no operator": "", "unknown operator": "normal", "unknown option": "dither --amplitud 3", "no mesh": f"mesh2sdf {MIMAKI}",
        "unknown choice": "dither -i surface.vdb --at corner", "unknown printer": "mesh2sdf part.stl --printer mimaki",
        "absent mesh": f"mesh2sdf gone.stl {MIMAKI} -o out.vdb", "absent input": "normals -i gone.vdb -o out.vdb",
        "absent grid": "dither -i tile.vdb -o out.vdb", "exists": "mask --size 8 -o tile.vdb",
        "absent folder": "mask --size 8 -o nowhere/out.vdb", "stream": f"mesh2sdf part.stl {MIMAKI} -o out.vdb --stream",
        "memory": f"mesh2sdf part.stl {MIMAKI} -o out.vdb --memory 1MiB",
        "layers": "normals -i surface.vdb -o out.vdb --layers 5:4",
        "slab": "normals -i surface.vdb -o out.vdb --slab 7", "source in a chain": f"read tile.vdb ! mesh2sdf part.stl {MIMAKI}",
        "empty step": "read tile.vdb ! ! info", "strict": f"mesh2sdf holed.stl {MIMAKI} --strict -o out.vdb",
        "band": "offset -i surface.vdb --by 0.3mm -o out.vdb", "shallow": "dither -i surface.vdb --amplitude 8 -o out.vdb",
        "no vdb": "info part.stl", "empty input": "info",
        "unknown material": "material-assign -i solid.vdb --material gold -o out.vdb",
        "lattices": "csg -i surface.vdb --union cubes.vdb -o out.vdb", "no stack": "slice-import part.stl -o out.vdb",
    }
    return {f"refused: {name}": f"vdbdither {line}" for name, line in lines.items()}


def surfaces():
    """mesh2sdf, resample, offset, csg, hollow, normals."""
    chains = {f"mesh2sdf {name}": f"vdbdither mesh2sdf {name} {MIMAKI} --json -o out.vdb"
              for name in (*whole_meshes(), *broken_meshes())}
    part = {f"on {name}": lattice for name, lattice in LATTICES.items()}
    part |= {options: f"{MIMAKI} {options}" for options in (
        "--unit cm --scale 0.1", "--unit in --scale 0.05", "--unit um --scale 1000", "--fit 1.5mm",
        "--rotate 10,20,30", "--place", "--rotate 90,0,45 --fit 2 --place", "--refine-y 2", "--refine-y 3", "--band 0.3mm",
        "--band 3", "--strict", "--normals", "--closest", "--normals --closest --band 0.2mm", "--layers 10:30", "--layers 0:1",
        "--slab 8", "--slab all --threads 1")}
    chains |= {f"mesh2sdf part.stl {name}": f"vdbdither mesh2sdf part.stl {options} -o out.vdb" for name, options in part.items()}
    for name in ("polygons.obj", "walls.stl", "overlap.stl", "membrane.stl", "soup-inwards.obj", "holed.stl"):
        chains[f"mesh2sdf {name} with all"] = (
            f"vdbdither mesh2sdf {name} --printer stratasys-j750-27um --normals {'' if 'soup' in name else '--closest'} "
            f"--band 2 --rotate 5,3,1 -o out.vdb && vdbdither stats out.vdb --json")
    chains |= {
        "mesh2sdf token": f"vdbdither mesh2sdf token.stl {MIMAKI} --fit 4mm --normals --json -o out.vdb",
        "mesh2sdf several": f"vdbdither mesh2sdf lower.stl upper.stl holed.stl {MIMAKI} --json -o out.vdb",
        "mesh2sdf several soups": f"vdbdither mesh2sdf soup-inwards.obj lower.stl {MIMAKI} --json -o out.vdb",
        "normals": "vdbdither normals -i deep.vdb -o out.vdb --threads 1",
        "normals of a token": f"vdbdither mesh2sdf token.stl {LATTICES['own']} --fit 3mm ! normals ! write out.vdb ! info --json",
    }
    chains |= {f"resample {options}": f"vdbdither resample {options} -o out.vdb" for options in (
        f"cubes.vdb {MIMAKI}", f"cubes.vdb {LATTICES['j750-27um']} --place --scale 0.8", f"cubes.vdb {MIMAKI} --band 0.15mm",
        f"cubes.vdb {MIMAKI} --level 0.02", "surface.vdb --pitch 40um,40um,40um --unit mm",
        f"printed.vdb {MIMAKI} --grid printed",
        f"printed.vdb {MIMAKI} --grid printed --kind fog --level 0.4", f"turned.vdb {MIMAKI}", f"turned.vdb {LATTICES['cubes']}",
        f"cubes.vdb {MIMAKI} --unit cm --scale 0.1 --kind level-set --grid surface")}
    chains["resample from a pipe"] = f"cat cubes.vdb | vdbdither resample - {MIMAKI} --slab 8 --threads 1 -o out.vdb"
    chains |= {f"offset {options}": f"vdbdither offset -i deep.vdb {options} -o out.vdb" for options in (
        "--by 0.1mm", "--by -0.1mm", "--by 0.05 --at foot", "--map waves8.png --height 0.1mm", "--map waves16.png --height -0.08",
        "--map waves16.png --height 0.1 --along x --pixel 0.1", "--map waves8.png --height 0.1 --along y --at foot",
        "--map heights.exr --height 0.1 --by 0.02", "--grid surface --most 0.2")}
    chains["offset by a grid"] = (f"vdbdither mesh2sdf box.stl {MIMAKI} --band 1.15mm ! dither --mask none ! simulate ! "
                                  "offset --grid printed --most 1 -o out.vdb")
    for name, base, other in (("surface", "surface.vdb", "second.vdb"), ("deep", "deep.vdb", "second-deep.vdb")):
        for how in ("union", "intersection", "difference"):
            chains[f"csg {how} of {name}"] = f"vdbdither csg -i {base} --{how} {other} -o out.vdb"
    chains |= {
        "csg of parts": "vdbdither read pair.vdb ! csg --union second.vdb --priority second ! material-assign "
                        "--parts white,black,cyan ! slice-export out",
        "csg layers": "vdbdither read surface.vdb ! csg --union second.vdb ! normals ! dither --layers 20:50 -o out.vdb",
        "csg of a named pipe": f"mkfifo out.fifo; mesh2sdf ball.stl {MIMAKI} --slab 16 > out.fifo & vdbdither read surface.vdb ! "
                               "csg --difference out.fifo -o out.vdb && wait $! && rm out.fifo",
    }
    chains |= {f"hollow {options}": f"vdbdither hollow -i deep.vdb {options} -o out.vdb" for options in (
        "--thickness 0.2mm", "--thickness 150um --drain 0,0,-0.6:0,0,1:0.4mm",
        "--thickness 0.2mm --drain 0,0,0.8:0.1,0.2,1:0.3mm --drain 1.2,0,0:1,0,0:0.3mm --slab 8 --threads 1")}
    return chains


def voxels():
    """dither, interlace, material-assign, simulate, masks."""
    dithers = ["", "--preset paper --size 24", "--mask none", "--mask white", "--mask white --seed 7", "--mask tile.vdb",
               "--mask tile.vdb --preset paper", "--mask paper --size 16", "--size 16", "--size 16 --sigma 1.3 --seed 5",
               "--preset paper --mask white", "--preset paper --mask blue", "--preset paper --mask none",
               "--amplitude 1", "--amplitude 2 --mask white", "--amplitude 0", "--method mask",
               "--spread 20um", "--spread 0.1mm", "--displaced", "--displaced --preset paper --mask white", "--guard none",
               "--guard walls --preset paper --mask white", "--slab 8 --threads 1", "--slab all --threads 2", "--layers 20:40"]
    dithers += [f"--at {at} --mask {mask} {more}".strip() for at in ("closest", "foot", "voxel")
                for mask, more in (("blue", ""), ("white", "--amplitude 3 --guard none"), ("tile.vdb", "--preset paper"))]
    chains = {}
    for name in ("surface", "normals"):
        chains |= {f"dither {name} {options}".strip(): f"vdbdither dither -i {name}.vdb {options} -o out.vdb".replace("  ", " ")
                   for options in dithers if name == "surface" or "foot" in options or "preset" in options or not options}
    for mesh in ("walls.stl", "thin.stl", "token.stl --fit 4mm", "slope.stl", "cavity.stl"):
        for options in ("", "--guard none", "--preset paper --mask white", "--at closest"):
            chains[f"dither {mesh} {options}".strip()] = (
                f"vdbdither mesh2sdf {mesh} {MIMAKI} --band 2 ! dither {options} -o out.vdb".replace("  ", " "))
    for name, lattice in LATTICES.items():
        chains[f"dither on {name}"] = f"vdbdither mesh2sdf ball.stl {lattice} ! dither --displaced -o out.vdb"
        chains[f"interlace on {name}"] = f"vdbdither mesh2sdf part.stl {lattice} --refine-y 2 ! interlace -o out.vdb"
        chains[f"simulate on {name}"] = f"vdbdither mesh2sdf box.stl {lattice} ! dither --mask none ! simulate -o out.vdb"
    chains |= {
        "interlace unrefined": "vdbdither interlace -i surface.vdb -o out.vdb --slab 8 --threads 1",
        "interlace normals": f"vdbdither mesh2sdf part.stl {MIMAKI} --normals ! interlace ! slice-export out --layers 5:40",
        "material-assign parts of a part": "vdbdither material-assign -i solid.vdb --parts white -o out.vdb",
    }
    chains |= {f"simulate {options}": f"vdbdither simulate -i solid.vdb {options} -o out.vdb" for options in (
        "--spread 20um", "--spread 0.04,0.08,0.02", "--spread 0", "--slab 8 --threads 1")}
    chains |= {f"material-assign {options}": f"vdbdither material-assign -i pair.vdb {options} -o out.vdb" for options in (
        "", "--material black", "--material gold=#ffd700", "--material gold=255,215,0,200", "--parts white,black",
        "--parts white,white", "--parts a=#010203,b=4,5,6,7", "--shell 0.1mm:white --core clear",
        "--shell 0.2:white,0.1:black --core cyan", "--shell 60um:own=#123456 --core white --slab 8 --threads 1",
        "--shell 5mm:white --core black")}
    chains |= {f"mask {options}": f"vdbdither mask {options} -o out.vdb" for options in (
        "--size 8", "--size 16", "--size 16 --seed 3", "--size 16,8,4", "--size 15,7,9", "--size 32,32,1 --sigma 1.5",
        "--size 16 --kernel gauss", "--size 16 --kernel axis-mix",
        "--size 16 --kernel axis-mix --plane-sigma 1.5 --space-weight 1",
        "--size 12 --sigma 1.1,0.55,2.1", "--size 16 --kind white",
        "--size 16,8,4 --kind white --seed 9", "--size 16 --kind bayer", "--size 8,4,2 --kind bayer",
        "--size 16 --kind gradient-noise", "--size 16,24,8 --kind gradient-noise --cell 8 --seed 4",
        "--size 16 --threads 1 --slab 8", "--size 1", "--size 24 --kernel gauss --sigma 0.7 --threads 1")}
    chains |= {f"mask-spectrum {options}": f"vdbdither mask-spectrum {options} out.json" for options in (
        "-i tile.vdb --step 15 --plane-step 30", "-i tile.vdb --step 20 --plane-step 30 --pitch 0.042,0.084,0.022 --levels 3",
        "-i tile.vdb --step 30 --plane-step 45 --levels 0 --threads 1")}
    chains["mask-spectrum of a mask"] = ("vdbdither mask --size 16 --kind white ! mask-spectrum --step 15 --plane-step 30 "
                                         "--levels 2 out.json")
    return chains


def ways():
    """The main chain: fused, quoted, piped, by files, in pieces."""
    chains = {}
    for name, lattice in LATTICES.items():
        steps = [f"mesh2sdf part.stl {lattice}", "normals", "dither", "material-assign"]
        fused, export = " ! ".join(steps), "slice-export out"
        chains[f"fused on {name}"] = f"vdbdither {fused} ! {export} --json"
        chains[f"quoted on {name}"] = f"vdbdither run '{' | '.join(steps)} | {export}'"
        for slab, threads in ((8, 1), (32, 2)):
            common = f"--slab {slab} --threads {threads}"
            chains[f"piped on {name} {common}"] = " | ".join(
                f"{step} {common} | tee out{i}.frames" for i, step in enumerate(steps)) + f" | {export} {common}"
        chains[f"filed on {name}"] = (
            f"{steps[0]} -o out0.vdb && normals -i out0.vdb -o out1.vdb && dither -i out1.vdb -o out2.vdb && "
            f"material-assign -i out2.vdb -o out3.vdb && slice-export out -i out3.vdb")
        chains[f"kept on the way on {name}"] = (
            f"vdbdither {steps[0]} ! write out0.vdb ! normals ! write out1.vdb ! dither ! write out2.vdb --codec mask ! "
            f"material-assign ! write out3.vdb --half ! info ! stats ! {export}")
    main = f"vdbdither mesh2sdf token.stl {MIMAKI} --fit 3mm ! normals ! dither ! material-assign ! slice-export out"
    chains |= {f"token {options}": f"{main} {options}" for options in (
        "", "--slab 8 --threads 1", "--slab 8 --threads 2", "--slab all --threads 1", "--slab 24 --threads 2", "--layers 13:45",
        "--layers 0:1", "--layers 40:48 --slab 8", "--stream", "--memory 100MB", "--quiet")}
    chains |= {
        "to standard output": f"vdbdither mesh2sdf part.stl {MIMAKI} --slab 16 --json --threads 1",
        "words beside voxels": "vdbdither read surface.vdb ! info ! normals ! stats ! write --slab 8",
        "frames to a file": "vdbdither read solid.vdb --slab 8 | vdbdither write out.vdb",
        "file to a pipe": "cat solid.vdb | vdbdither material-assign --slab 16 | tee out.frames | slice-export out.zip",
        "layers over a pipe": f"mesh2sdf part.stl {MIMAKI} --slab 8 | dither --slab 8 | slice-export out --layers 20:30 --slab 8",
        "layers of a file": "vdbdither normals -i surface.vdb --layers 10:30 -o out.vdb && vdbdither info out.vdb --json",
        "quoted names": f"cp part.stl 'out of quotes.stl' && vdbdither run \"mesh2sdf 'out of quotes.stl' {MIMAKI} -o out.vdb\"",
        "overwrite": "vdbdither mask --size 8 -o out.vdb && vdbdither mask --size 4 -o out.vdb --overwrite",
        "the paper": f"vdbdither mesh2sdf token.stl {MIMAKI} --fit 3mm ! dither --preset paper --size 32 ! slice-export out",
        "competitor": f"vdbdither mesh2sdf token.stl {MIMAKI} --fit 3mm --refine-y 2 ! interlace ! material-assign ! "
                      "slice-export out",
        "geometry": "vdbdither read deep.vdb ! offset --by 0.05mm ! hollow --thickness 0.15mm ! normals ! dither ! "
                    "material-assign --material white ! slice-export out",
        "installed mask": "cp \"$(dirname \"$(command -v vdbdither)\")/share/masks/blue.vdb\" out.vdb && vdbdither info out.vdb",
        "installed printers": "cp -r \"$(dirname \"$(command -v vdbdither)\")/share/printers\" out",
    }
    return chains


def slices():
    """slice-export and slice-import."""
    chains = {}
    for name in ("layered", "solid"):
        formats = ["png", "png1", "png8", "tiff", "tiff1", "exr"]
        chains |= {f"slice-export {name} {f}": f"vdbdither slice-export -i {name}.vdb out --format {f}" for f in formats}
        chains |= {f"slice-import {name} {f}": f"vdbdither slice-export -i {name}.vdb stack --format {f} && "
                                               "vdbdither slice-import stack -o out.vdb && rm -r stack" for f in formats}
    exr = "read normals.vdb ! dither ! material-assign ! slice-export out --format exr"
    chains |= {f"slice-export {options}": f"vdbdither {exr} {options}" for options in (
        "--exr-packing none --layers 30:34", "--exr-packing rle --layers 30:34", "--exr-packing zip --exr-half --layers 30:50",
        "--exr-packing piz --layers 30:50", "--exr-tile 32 --layers 30:34",
        "--exr-tile 16 --exr-packing piz --exr-half --flip-x --layers 9:12", "--padding 3 --flip-y --layers 30:34")}
    chains |= {f"slice-export {options}": f"vdbdither slice-export -i layered.vdb {options}" for options in (
        "out --prefix layer- --digits 3 --first 17", "out --padding 5", "out --flip-x", "out --flip-y --padding 2",
        "out --background '#804020'", "out --background 1,2,3,4 --format tiff", "out.zip", "out.zip --format png1 --slab 8",
        "out.zip --format exr", "out --layers 3:9 --format tiff1 --flip-x --threads 1", "out --threads 1 --slab 8")}
    chains |= {
        "slice-import zip": "vdbdither slice-import stack.zip -o out.vdb && "
                            "vdbdither compare layered.vdb out.vdb --grids material,solid",
        "slice-import manifest": "vdbdither slice-export -i layered.vdb out --padding 2 --flip-x --first 7 && "
                                 "vdbdither slice-import out/manifest.json --slab 8 --threads 1 -o out.vdb",
        "slice-import to the end": "vdbdither slice-import stack.zip ! simulate ! mesh-export out.ply",
        "slice-import layers": "vdbdither slice-import stack.zip --layers 10:25 -o out.vdb",
        "slice-import of some layers": "vdbdither slice-export -i layered.vdb out --layers 10:40 && "
                                       "vdbdither slice-import out -o out0.vdb; "
                                       "vdbdither slice-import out --layers 17:33 -o out1.vdb",
        "slice-import of a damaged stack": "vdbdither slice-export -i layered.vdb out && "
                                           "echo >> out/slice_00003.png && vdbdither slice-import out --edited -o out.vdb",
    }
    return chains


def figures():
    """mesh-export, measure, render, ssim."""
    chains = {}
    for suffix in ("stl", "obj", "ply"):
        for grid in ("printed", "solid", "surface"):
            chains[f"mesh-export {grid} {suffix}"] = f"vdbdither mesh-export -i printed.vdb --grid {grid} out.{suffix}"
    chains |= {f"mesh-export {options}": f"vdbdither mesh-export -i printed.vdb {options} out.ply" for options in (
        "--grid displaced", "--grid surface --level 0.02", "--grid printed --level 0.3", "--smooth taubin --iterations 20",
        "--grid solid --smooth taubin --iterations 7 --threads 1", "--slab 8 --threads 1", "--layers 20:40")}
    chains |= {f"measure {options}": f"vdbdither measure -i slope-printed.vdb --reference slope.stl {options}" for options in (
        "", "--json", "--report out.json --map out.ply", "--grid solid --report out.json", "--grid surface --json",
        "--smooth taubin --iterations 10 --json", "--spacing 0.02mm --cutoff 0.4mm --margin 0.2mm --report out.json --threads 1",
        "--map out.ply --map-range 0.02mm --slab 8")}
    chains |= {
        "measure a mesh": "vdbdither measure slope.stl --reference slope.stl --json && vdbdither measure ball.stl --reference "
                          "cylinder.stl --report out.json --map out.ply",
        "measure placed": f"vdbdither mesh2sdf slope.stl {MIMAKI} --rotate 10,5,0 --fit 2 --place ! dither --mask none ! measure "
                          "--reference slope.stl --rotate 10,5,0 --fit 2 --place --report out.json",
        "measure pieces": f"vdbdither mesh2sdf apart.stl cavity.stl {MIMAKI} ! dither ! measure --reference cavity.stl --json",
    }
    small = "--pixel 0.06mm --samples 4"
    chains |= {f"render {options}": f"vdbdither render -i slope-printed.vdb out.png {small} {options}" for options in (
        "--look area", "--look large", "--look sky", "--look staircase", "--blocks", "--grid surface --azimuth 80 --elevation 10",
        "--grid solid --blocks --projection orthographic --seed 3", "--frame part.stl --margin 3",
        "--distance 30mm --brightness 0.4", "--threads 1 --slab 8")}
    chains |= {"render exr": f"vdbdither render -i slope-printed.vdb out.exr {small}",
               "render mesh": "vdbdither render token.stl out.png --pixel 0.4mm --samples 4 --threads 1",
               "render ply": f"vdbdither render little.ply out.exr --look sky {small}"}
    chains |= {f"ssim {options}".strip(): f"vdbdither ssim part-seen.png print-seen.png {options}" for options in (
        "", "--json", "--maps out", "--pixel 0.2mm --distance 300mm --background 0.2 --json")}
    return chains


def told():
    """read, write, info, stats, compare, printers."""
    chains = {}
    for name in ("surface", "normals", "solid", "printed", "layered", "pair", "tile", "cubes", "turned"):
        chains |= {f"info {name}": f"vdbdither info {name}.vdb", f"info {name} --json": f"vdbdither info {name}.vdb --json"}
    for name in ("surface", "solid", "layered", "pair"):
        chains |= {f"stats {name}": f"vdbdither stats {name}.vdb", f"stats {name} --json": f"vdbdither stats {name}.vdb --json"}
    chains |= {f"stats {options}": f"vdbdither stats {options}" for options in (
        "printed.vdb --histogram printed", "surface.vdb --histogram surface --bins 7 --json", "tile.vdb --histogram mask --json",
        "layered.vdb --histogram material --slab 8 --threads 1 --json")}
    chains |= {f"compare {options}": f"vdbdither compare {options}" for options in (
        "solid.vdb solid.vdb", "solid.vdb normals.vdb", "surface.vdb second.vdb --json", "surface.vdb second.vdb",
        "surface.vdb cubes.vdb", "deep.vdb surface.vdb --tolerance 0.5", "solid.vdb printed.vdb --grids solid,surface --json")}
    chains |= {f"write {options}": f"vdbdither read printed.vdb ! write out.vdb {options}" for options in (
        "--codec none", "--codec mask", "--codec blosc", "--half", "--half --codec mask", "--threads 1 --slab 8")}
    chains |= {
        "read grids": "vdbdither read printed.vdb --grids surface,printed -o out.vdb",
        "half goes on": "vdbdither read normals.vdb ! write out0.vdb --half && vdbdither dither -i out0.vdb -o out1.vdb",
        "read foreign": "vdbdither info turned.vdb; vdbdither read turned.vdb -o out.vdb",
        "printers": "vdbdither printers",
        "printers --json": "vdbdither printers list --json",
        "printers show": "vdbdither printers show mimaki-3duj-553 && vdbdither printers show own.json",
        "printers show --json": "vdbdither printers show own.json --json",
        "printers check": "vdbdither printers check own.json; vdbdither printers check wrong.json",
        "printers check --json": "vdbdither printers check wrong.json --json",
    }
    return chains


def all_chains():
    chains = {}
    for group in (words(), refusals(), surfaces(), voxels(), ways(), slices(), figures(), told()):
        assert not chains.keys() & group.keys(), chains.keys() & group.keys()
        chains |= group
    return chains
