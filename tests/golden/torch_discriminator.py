"""StyleGAN2's residual discriminator and the losses of adversarial training in plain PyTorch, for
numbers to compare the C++ code with.

Written from the layer list of Karras et al. 2020 (images as N, C, H, W), not from the C++ code:
gains after each leaky ReLU, the sum of main and skip divided at its end, every blur computed in
full. Parameters have the names and shapes of the C++ code.
"""

import torch
import torch.nn.functional as F

ROOT2 = 2**0.5


def activated(x):
    return F.leaky_relu(x, 0.2) * ROOT2


def blurred(x, padding):
    line = torch.tensor([1.0, 3.0, 3.0, 1.0], dtype=x.dtype) / 8.0
    kernel = (line[:, None] * line[None, :]).expand(x.shape[1], 1, 4, 4)
    return F.conv2d(F.pad(x, (padding,) * 4), kernel, groups=x.shape[1])


class Convolution:
    """With equalised learning rate."""

    def __init__(self, create, name, inputs, outputs, kernel, bias=True):
        self.weight = create(f"{name}.weight", outputs, kernel, kernel, inputs)
        self.bias = create(f"{name}.bias", outputs, scale=0.25) if bias else None

    def __call__(self, x, **options):
        weight = self.weight.permute(0, 3, 1, 2) / self.weight[0].numel() ** 0.5
        return F.conv2d(x, weight, self.bias, **options)


class Dense:
    def __init__(self, create, name, inputs, outputs):
        self.weight = create(f"{name}.weight", outputs, inputs)
        self.bias = create(f"{name}.bias", outputs, scale=0.25)

    def __call__(self, x):
        return F.linear(x, self.weight / self.weight.shape[1] ** 0.5, self.bias)


class Block:
    def __init__(self, create, name, inputs, outputs):
        self.conv0 = Convolution(create, f"{name}.conv0", inputs, inputs, 3)
        self.conv1 = Convolution(create, f"{name}.conv1", inputs, outputs, 3)
        self.skip = Convolution(create, f"{name}.skip", inputs, outputs, 1, bias=False)

    def __call__(self, x):
        main = activated(self.conv0(x, padding=1))
        main = activated(self.conv1(blurred(main, 2), stride=2))
        return (main + self.skip(blurred(x, 1), stride=2)) / ROOT2


def with_deviation(x, group_size):
    batch, channels, height, width = x.shape
    groups = x.reshape(group_size, batch // group_size, channels, height, width)
    deviation = torch.sqrt(groups.var(0, unbiased=False) + 1e-8).mean((1, 2, 3))
    return torch.cat(
        [x, deviation.repeat(group_size)[:, None, None, None].expand(-1, 1, height, width)], 1
    )


class Discriminator:
    def __init__(self, create, name, resolution, max_channels=512, group_size=4, multiplier=2.0):
        def channels(side):
            return min(max_channels, 512 if side < 64 else int(16384 * multiplier / side))

        self.group_size = group_size
        self.from_rgb, self.blocks = {}, {}
        side = 8
        while side <= resolution:
            self.blocks[side] = Block(
                create, f"{name}.block{side}", channels(side), channels(side // 2)
            )
            if side >= 64:
                self.from_rgb[side] = Convolution(
                    create, f"{name}.from_rgb{side}", 3, channels(side), 1
                )
            side *= 2
        self.conv = Convolution(create, f"{name}.epilogue.conv", channels(4) + 1, channels(4), 3)
        self.hidden = Dense(create, f"{name}.epilogue.hidden", 16 * channels(4), channels(4))
        self.logit = Dense(create, f"{name}.epilogue.logit", channels(4), 1)

    def __call__(self, images, fade=1.0):
        side = images.shape[2]
        x = self.blocks[side](activated(self.from_rgb[side](images)))
        side //= 2
        if fade < 1.0:
            x = torch.lerp(activated(self.from_rgb[side](F.avg_pool2d(images, 2))), x, fade)
        while side > 4:
            x = self.blocks[side](x)
            side //= 2
        x = activated(self.conv(with_deviation(x, min(self.group_size, len(x))), padding=1))
        return self.logit(activated(self.hidden(x.permute(0, 2, 3, 1).flatten(1))))


def faded(images, fade):
    return torch.lerp(
        F.interpolate(F.avg_pool2d(images, 2), scale_factor=2, mode="nearest"), images, fade
    )


def generator_loss(fake_logits):
    return F.softplus(-fake_logits).mean()


def discriminator_loss(real_logits, fake_logits):
    return F.softplus(-real_logits).mean() + F.softplus(fake_logits).mean()


def r1_penalty(discriminator, real_images):
    images = real_images.detach().requires_grad_()
    (gradient,) = torch.autograd.grad(discriminator(images).sum(), images, create_graph=True)
    return gradient.square().sum((1, 2, 3)).mean() / 2
