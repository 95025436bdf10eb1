"""The parts that come with pcsr, registered through the entry-point group `pcsr` like those of any plugin.

The networks, TAPSR first. Each is five parts: an encoder, a fusion of touches, a backbone, an upsampler and an
objective. Recipes are in `pcsr/recipes`. Each part has a file or a folder of its name, with underscores for hyphens.

==================  ===============  ===============  ===============  ============  ==============  =================
recipe              encoder          fusion           backbone         upsampler     objective       source
==================  ===============  ===============  ===============  ============  ==============  =================
tapsr               unet             iterative        pu-transformer   shuffle       chamfer         TAPSR, Sec. 3
tapsr-midpoint      unet             iterative        pu-transformer   midpoint      chamfer         Grad-PU, Sec. 3.2
ablation/raw        mlp              none             pu-transformer   shuffle       chamfer         TAPSR, Sec. 4.4
ablation/concat     unet             concat           pu-transformer   shuffle       chamfer         TAPSR, Sec. 4.4
ablation/edge-conv  unet             edge-conv        pu-transformer   shuffle       chamfer         our own
ablation/attention  unet             cross-attention  pu-transformer   shuffle       chamfer         our own
field               local-frames     joint-cloud      local-frames     rated-edges   surface-passes  our own
frames              local-frames     joint-cloud      local-frames     edge-offsets  surface         our own
pu-transformer      mlp              none             pu-transformer   shuffle       chamfer         PU-Transformer
pu-net              set-abstraction  none             pu-net           branches      pu-net          PU-Net
mpu                 linear           none             dense-edge-conv  progressive   progressive     3PU, Sec. 3
pu-gan              linear           none             dense-edge-conv  up-down-up    pu-gan          PU-GAN, Sec. 3
pu-gcn              edge-conv        none             pu-gcn           node-shuffle  chamfer         PU-GCN
dis-pu              linear           none             dense-edge-conv  dis-pu        dis-pu          Dis-PU
grad-pu             mlp              none             grad-pu          descent       grad-pu         Grad-PU, Sec. 3
==================  ===============  ===============  ===============  ============  ==============  =================

Touches come from `touch`, objects from `shapes`, what networks are compared with from `baselines`. What parts share
is in `layers`. A part is registered by text, so that neither it nor torch is imported before a recipe asks for it.
"""

from pcsr import Register, hookimpl


@hookimpl
def pcsr_register(register: Register) -> None:
    """Register the parts of the paper and of other networks, data, metrics, baselines, policies and the logger."""
    register.encoder("edge-conv", "pcsr_plugins.encoders.edge_conv:EdgeConv")
    register.encoder("local-frames", "pcsr_plugins.encoders.local_frames:LocalFrameEncoder")
    register.encoder("linear", "pcsr_plugins.encoders.linear:Linear")
    register.encoder("mlp", "pcsr_plugins.encoders.mlp:Mlp")
    register.encoder("set-abstraction", "pcsr_plugins.encoders.set_abstraction:BallEncoder")
    register.encoder("unet", "pcsr_plugins.encoders.unet:UNet")

    register.fusion("cross-attention", "pcsr_plugins.fusions.cross_attention:CrossAttention")
    register.fusion("edge-conv", "pcsr_plugins.fusions.edge_conv:EdgeConvFusion")
    register.fusion("concat", "pcsr_plugins.fusions.concat:Concat")
    register.fusion("joint-cloud", "pcsr_plugins.fusions.joint_cloud:JointCloud")
    register.fusion("iterative", "pcsr_plugins.fusions.iterative:Iterative")
    register.fusion("none", "pcsr_plugins.fusions.none:NoFusion")

    register.backbone("dense-edge-conv", "pcsr_plugins.backbones.dense_edge_conv:DenseEdgeConvs")
    register.backbone("local-frames", "pcsr_plugins.backbones.local_frames:LocalFrameBackbone")
    register.backbone("grad-pu", "pcsr_plugins.backbones.grad_pu:GradPU")
    register.backbone("pu-gcn", "pcsr_plugins.backbones.pu_gcn:PUGCN")
    register.backbone("pu-net", "pcsr_plugins.backbones.pu_net:PUNet")
    register.backbone("pu-transformer", "pcsr_plugins.backbones.pu_transformer:PUTransformer")

    register.upsampler("branches", "pcsr_plugins.upsamplers.branches:Branches")
    register.upsampler("descent", "pcsr_plugins.upsamplers.descent:Descent")
    register.upsampler("dis-pu", "pcsr_plugins.upsamplers.dis_pu:DisPU")
    register.upsampler("edge-offsets", "pcsr_plugins.upsamplers.edge_offsets:EdgeOffsets")
    register.upsampler("midpoint", "pcsr_plugins.upsamplers.midpoint:Midpoint")
    register.upsampler("node-shuffle", "pcsr_plugins.upsamplers.node_shuffle:NodeShuffle")
    register.upsampler("progressive", "pcsr_plugins.upsamplers.progressive:Progressive")
    register.upsampler("rated-edges", "pcsr_plugins.upsamplers.rated_edges:RatedEdges")
    register.upsampler("shuffle", "pcsr_plugins.upsamplers.shuffle:Shuffle")
    register.upsampler("up-down-up", "pcsr_plugins.upsamplers.up_down_up:UpDownUp")

    register.objective("chamfer", "pcsr_plugins.objectives.chamfer:Chamfer")
    register.objective("dis-pu", "pcsr_plugins.objectives.dis_pu:DisPU")
    register.objective("grad-pu", "pcsr_plugins.objectives.grad_pu:GradPU")
    register.objective("progressive", "pcsr_plugins.objectives.progressive:ProgressiveChamfer")
    register.objective("pu-gan", "pcsr_plugins.objectives.pu_gan:PuGan")
    register.objective("pu-net", "pcsr_plugins.objectives.pu_net:PUNetLoss")
    register.objective("surface", "pcsr_plugins.objectives.surface:Surface")
    register.objective("surface-passes", "pcsr_plugins.objectives.surface_passes:SurfacePasses")

    register.touch("digit", "pcsr_plugins.touch.digit:Digit")
    register.touch("recorded", "pcsr_plugins.touch.recorded:Recorded")
    register.touch("surface", "pcsr_plugins.touch.surface:Surface")

    register.shapes("blobs", "pcsr_plugins.shapes.blobs:Blobs")
    register.shapes("cad-parts", "pcsr_plugins.shapes.cad_parts:CadParts")
    register.shapes("meshes", "pcsr_plugins.shapes.meshes:Meshes")

    register.metric("cd", "pcsr.metrics:Chamfer")
    register.metric("hd", "pcsr.metrics:Hausdorff")
    register.metric("hd-pugcn", "pcsr.metrics:HausdorffPUGCN")
    register.metric("emd", "pcsr.metrics:EarthMovers")
    register.metric("p2f", "pcsr.metrics:PointToFace")

    register.baseline("midpoint", "pcsr_plugins.baselines.midpoint:Midpoint")
    register.baseline("floor", "pcsr_plugins.baselines.floor:Floor")

    register.policy("expected-error", "pcsr_plugins.policies.expected_error:ExpectedError")
    register.policy("grasp", "pcsr_plugins.policies.grasp:Grasp")
    register.policy("sparse", "pcsr_plugins.policies.sparse:Sparse")
    register.policy("spread", "pcsr_plugins.policies.spread:Spread")
    register.policy("uniform", "pcsr_plugins.policies.uniform:Uniform")

    register.logger("jsonl", "pcsr.experiments.history:JsonLines")
