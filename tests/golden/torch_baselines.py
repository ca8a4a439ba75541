"""What the paper compares with, in plain PyTorch: HeadNeRF's conditioning, and a field that is
rendered at full resolution.

Written from the description of HeadNeRF, not from the C++ code: the codes are repeated at every
sample, and the last layer is applied to every sample.
"""

import torch
import torch.nn.functional as F

from torch_model import ROOT2, Equalised, blur, doubled, leaky


class ConcatenatedField:
    """Plain ReLU layers on [encoded point, identity, expression]; texture and light join the
    features."""

    def __init__(self, create, name, size, channels, colors):
        self.frequencies, self.colors, width = size.frequencies, colors, size.field_width
        entering = 3 + 6 * size.frequencies + 179
        self.skip = size.field_layers // 2 + 1 if size.field_layers >= 4 else None
        self.layers = []
        for i in range(size.field_layers):
            inputs = entering if i == 0 else width + entering if i == self.skip else width
            self.layers.append(Equalised(create, f"{name}.layer{i}", inputs, width))
        self.density = Equalised(create, f"{name}.density", width, 1)
        self.feature0 = Equalised(create, f"{name}.feature0", width, width)
        self.feature1 = Equalised(create, f"{name}.feature1", width + 127, width // 2)
        self.feature2 = Equalised(create, f"{name}.feature2", width // 2, channels)

    def __call__(self, points, geometry, appearance):
        entering = [points]
        for k in range(self.frequencies):
            entering += [torch.sin(2.0**k * points), torch.cos(2.0**k * points)]
        entering = torch.cat(entering + [repeated(geometry, points)], 1)
        x = entering
        for i, layer in enumerate(self.layers):
            x = F.relu(ROOT2 * layer(torch.cat([entering, x], 1) if i == self.skip else x))
        features = torch.cat([self.feature0(x), repeated(appearance, points)], 1)
        features = self.feature2(F.relu(ROOT2 * self.feature1(features)))
        return F.softplus(self.density(x) - 1.0), (
            torch.sigmoid(features) if self.colors else features
        )


def repeated(code, points):
    """A code of each face at every sample."""
    return code[:, :, None, None].expand(-1, -1, *points.shape[2:])


def composited(density, deltas, features):
    alpha = 1.0 - torch.exp(-density * deltas)
    passed = torch.cumprod(1.0 - alpha, 3)
    weights = alpha * torch.cat([torch.ones_like(alpha[..., :1]), passed[..., :-1]], 3)
    return (weights * features).sum(3), passed[:, 0, :, -1:]


def geometry_of(z):
    return torch.cat([z["id"], z["expr"]], 1)


def appearance_of(z):
    return torch.cat([z["tex"], z["light"]], 1)


class HeadNerf:
    """Field with concatenation, and render blocks that no code enters."""

    def __init__(self, create, name, size):
        self.size = size
        self.field = ConcatenatedField(
            create, f"{name}.field", size, size.feature_channels, colors=False
        )
        self.blocks, self.laterals = [], []
        inputs, side = size.feature_channels, 2 * size.rays_per_side
        for channels in size.block_channels:
            block = f"{name}.block{side}"
            if not self.blocks:
                self.to_rgb_below = Equalised(create, f"{block}.to_rgb_below", inputs, 3)
            self.blocks.append(
                (
                    Equalised(create, f"{block}.widened", inputs, 2 * inputs),
                    Equalised(create, f"{block}.detail", 2 * inputs, 4 * inputs),
                    Equalised(create, f"{block}.narrowed", inputs, channels),
                    Equalised(create, f"{block}.to_rgb", channels, 3),
                )
            )
            self.laterals.append(
                Equalised(create, f"{name}.mask.lateral{side}", channels, size.mask_channels)
            )
            inputs, side = channels, 2 * side
        self.logit = Equalised(create, f"{name}.mask.logit", size.mask_channels, 1)

    def __call__(self, z, rays):
        points, deltas, _ = rays
        side = self.size.rays_per_side
        density, features = self.field(points, geometry_of(z), appearance_of(z))
        x, _ = composited(density, deltas, features)
        x = x.reshape(len(points), -1, side, side)
        result = {"feature_map": x, "images": []}
        rgb, total = self.to_rgb_below(x), 0.0
        for (widened, detail, narrowed, to_rgb), lateral in zip(self.blocks, self.laterals):
            detailed = leaky(detail(leaky(widened(x), 1.0)), 1.0)
            x = leaky(
                narrowed(blur(F.pixel_shuffle(detailed + x.repeat_interleave(4, dim=1), 2))), ROOT2
            )
            rgb = to_rgb(x) + blur(doubled(rgb))
            result["images"].append(torch.tanh(rgb))
            total = leaky(lateral(x), 1.0) + (doubled(total) if torch.is_tensor(total) else total)
        result["mask_logit"] = self.logit(total)
        return result


class PixelNerf:
    """One ray for each pixel of the largest image, with its colour; the mask is the opacity. The
    smaller image has half its side."""

    def __init__(self, create, name, size):
        self.size = size
        self.field = ConcatenatedField(create, f"{name}.field", size, 3, colors=True)

    def __call__(self, z, rays):
        points, deltas, _ = rays
        side = self.size.rays_per_side
        density, colors = self.field(points, geometry_of(z), appearance_of(z))
        x, clear = composited(density, deltas, colors)
        x = 2.0 * x.reshape(len(points), 3, side, side) - 1.0
        clear = clear.reshape(len(points), 1, side, side)
        logit = torch.log(1.0 - clear + 1e-6) - torch.log(clear + 1e-6)
        return {"feature_map": x, "images": [F.avg_pool2d(x, 2), x], "mask_logit": logit}
