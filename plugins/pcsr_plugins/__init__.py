"""The first-party parts. They come in through the same door as everyone else's: the entry-point group `pcsr`.

One part a file, the file's name is the part's name. A part is named here by text, so that neither it nor torch
is imported before a recipe asks for it.
"""

from pcsr import Register, hookimpl


@hookimpl
def pcsr_register(register: Register) -> None:
    """Register the parts of the paper, its baselines, and the embedded data."""
    register.encoder("mlp", "pcsr_plugins.encoders.mlp:Mlp")
    register.encoder("unet", "pcsr_plugins.encoders.unet:UNet")

    register.fusion("concat", "pcsr_plugins.fusions.concat:Concat")
    register.fusion("iterative", "pcsr_plugins.fusions.iterative:Iterative")
    register.fusion("none", "pcsr_plugins.fusions.none:NoFusion")

    register.backbone("pu-transformer", "pcsr_plugins.backbones.pu_transformer:PUTransformer")

    register.upsampler("shuffle", "pcsr_plugins.upsamplers.shuffle:Shuffle")

    register.objective("chamfer", "pcsr_plugins.objectives.chamfer:Chamfer")

    register.touch("digit", "pcsr_plugins.touch.digit:Digit")
    register.touch("recorded", "pcsr_plugins.touch.recorded:Recorded")

    register.shapes("cad-parts", "pcsr_plugins.shapes.cad_parts:CadParts")
    register.shapes("meshes", "pcsr_plugins.shapes.meshes:Meshes")
