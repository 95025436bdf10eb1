"""Every family of parts by its name. Importing this imports manifold3d, which making a part needs."""

from pcsr_plugins.shapes.cad_parts import (
    blocks,
    fasteners,
    moulded,
    pipes,
    plates,
    stock,
    toothed,
    turned_parts,
)
from pcsr_plugins.shapes.shared.generated import by_name

FAMILIES = by_name(
    *(plates.adapter, plates.bracket, plates.buckle, plates.flange, plates.gasket, plates.hinge),
    *(plates.plate, plates.sheet_bracket),
    *(blocks.arch, blocks.clamp, blocks.heat_sink, blocks.housing, blocks.joint, blocks.lever),
    *(blocks.machined_block, blocks.manifold_block, blocks.pillow_block),
    *(fasteners.bolt, fasteners.chain_link, fasteners.clip, fasteners.hook, fasteners.nut),
    *(fasteners.spring, fasteners.stand_off),
    *(moulded.pad, moulded.spanner, moulded.tray),
    *(pipes.duct, pipes.elbow, pipes.tee, pipes.valve),
    *(stock.circlip, stock.profile, stock.rod, stock.washer),
    *(toothed.cam, toothed.gear, toothed.impeller, toothed.ratchet, toothed.sprocket),
    *(turned_parts.bearing, turned_parts.bushing, turned_parts.handwheel, turned_parts.knob),
    *(turned_parts.lamp_post, turned_parts.nozzle, turned_parts.pulley, turned_parts.shaft),
)
