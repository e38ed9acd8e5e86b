"""Initial weights (He et al. 2015, with the exceptions of the official repository)."""

from __future__ import annotations

from torch import nn

from navcore.perception.esanet.network.decoder import Decoder, DecoderModule, LearnedUpsampling
from navcore.perception.esanet.network.fusion import SqueezeExcite


def initialise(network: nn.Module) -> None:
    """He-initialise (fan-out) every convolution that is followed by a ReLU; batch norms start as
    the identity.

    The others keep torch's initialisation, as do all biases: logits and inputs of a sigmoid are not
    followed by a ReLU, and the learned upsampling is initially bilinear.
    """
    exempt = _not_before_a_relu(network)
    for module in network.modules():
        if isinstance(module, nn.BatchNorm2d):
            module.reset_parameters()
        elif isinstance(module, LearnedUpsampling):
            module.reset_to_bilinear()
        elif isinstance(module, nn.Conv2d) and module not in exempt:
            nn.init.kaiming_normal_(module.weight, mode="fan_out", nonlinearity="relu")


def _not_before_a_relu(network: nn.Module) -> set[nn.Module]:
    """Return the convolutions without a ReLU, by their position in the network.

    The official code selects by `out_channels == classes`, which hits the encoders at 64 classes.
    """
    exempt: set[nn.Module] = set()
    for module in network.modules():
        if isinstance(module, SqueezeExcite):
            exempt.add(module.fc[2])
        elif isinstance(module, Decoder):
            exempt.add(module.conv_out)
        elif isinstance(module, DecoderModule):
            exempt.add(module.side_output)
        elif isinstance(module, LearnedUpsampling):
            exempt.add(module.conv)
    return exempt
