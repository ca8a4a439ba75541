"""PyTorch peer of the StyleMorpheus decoder, fitter and stage-1 step: what a user would run today.

Written from the paper and HeadNeRF's published figures; random weights. Times the same work as
stymo-bench on the same machine (batch 1, float32), and is never an oracle for values. Debian:
python3-torch python3-torchvision. usage: torch_peer.py [--threads 2] [--width 256] [--layers 8]
[--res 512] render|render-bfloat16|fit|fit-lpips|train|train-lpips|disc|r1|
celeba-64|celeba-128|celeba-256 ... (disc and r1: one update of the
discriminator on --batch images, without and with the R1 penalty alone)
celeba-64, celeba-128, celeba-256: a whole stage-1 step of that configuration on eight images, with
MobileFaceNet as encoder, LPIPS (SqueezeNet), Adam and the EMA of the weights
"""

import argparse, math, time
import torch, torch.nn as nn, torch.nn.functional as F


class ModConv(nn.Module):
    """1x1 modulated convolution with weight demodulation (StyleGAN2), batch-1 fast path by
    folding."""

    def __init__(self, cin, cout, sdim, demod=True):
        super().__init__()
        self.w = nn.Parameter(torch.randn(cout, cin) / math.sqrt(cin))
        self.b = nn.Parameter(torch.zeros(cout))
        self.aff = nn.Linear(sdim, cin)
        nn.init.ones_(self.aff.bias)
        self.demod = demod

    def fold(self, s):
        w = self.w[None] * self.aff(s)[:, None, :]
        if self.demod:
            w = w * torch.rsqrt(w.pow(2).sum(-1, keepdim=True) + 1e-8)
        return w

    def points(self, x, s):  # x [B, P, cin]
        return torch.baddbmm(self.b[None, None], x, self.fold(s).transpose(1, 2))

    def forward(self, x, s):  # x [B, cin, H, W]
        w = self.fold(s)
        if x.shape[0] == 1:
            return F.conv2d(x, w[0, :, :, None, None], self.b)
        B, C, H, W = x.shape
        y = torch.bmm(w, x.view(B, C, H * W)).view(B, -1, H, W)
        return y + self.b[None, :, None, None]


class Nerf(nn.Module):
    def __init__(self, width=256, layers=8, sdim=179, feat=256, freqs=10):
        super().__init__()
        self.freqs = freqs
        d = 3 + 6 * freqs
        self.skip = layers // 2
        self.layers = nn.ModuleList(
            [
                ModConv(d if i == 0 else width + (d if i == self.skip else 0), width, sdim)
                for i in range(layers)
            ]
        )
        self.sigma = nn.Linear(width, 1)
        self.feat = ModConv(width, feat, sdim)

    def encode(self, p):
        f = 2.0 ** torch.arange(self.freqs, dtype=p.dtype)
        a = (p[..., None, :] * f[:, None]).flatten(-2)
        return torch.cat([p, a.sin(), a.cos()], -1)

    def forward(self, p, s):
        e = self.encode(p)
        x = e
        for i, l in enumerate(self.layers):
            if i == self.skip:
                x = torch.cat([x, e], -1)
            x = torch.sin(l.points(x, s))
        return F.softplus(self.sigma(x)), self.feat.points(x, s)


def blur(x):
    k = x.new_tensor([1.0, 2.0, 1.0])
    k = (k[:, None] * k[None]) / 16
    return F.conv2d(
        F.pad(x, (1, 1, 1, 1), mode="replicate"), k.expand(x.shape[1], 1, 3, 3), groups=x.shape[1]
    )


class Block(nn.Module):
    def __init__(self, cin, cout, sdim):
        super().__init__()
        self.u1 = nn.Conv2d(cin, cin * 2, 1)
        self.u2 = nn.Conv2d(cin * 2, cin * 4, 1)
        self.m1 = ModConv(cin, cout, sdim)
        self.m2 = ModConv(cout, cout, sdim)
        self.rgb = nn.Conv2d(cout, 3, 1)

    def forward(self, x, s, rgb):
        y = F.leaky_relu(self.u2(F.leaky_relu(self.u1(x), 0.2)), 0.2) + x.repeat(1, 4, 1, 1)
        x = blur(F.pixel_shuffle(y, 2))
        x = F.leaky_relu(self.m1(x, s), 0.2)
        x = F.leaky_relu(self.m2(x, s), 0.2)
        c = self.rgb(x)
        if rgb is not None:
            c = c + blur(F.interpolate(rgb, scale_factor=2, mode="bilinear", align_corners=False))
        return x, c


class Decoder(nn.Module):
    def __init__(self, width=256, layers=8, res=512, feat=256, channels=None, freqs=10):
        super().__init__()
        self.nerf = Nerf(width, layers, 179, feat, freqs)
        ch = [feat] + (channels or [128, 64, 32, 32][: int(math.log2(res)) - 5])
        self.blocks = nn.ModuleList([Block(ch[i], ch[i + 1], 127) for i in range(len(ch) - 1)])
        self.map = nn.ModuleList(
            [
                nn.Sequential(*[m for _ in range(4) for m in (nn.Linear(d, d), nn.LeakyReLU(0.2))])
                for d in (100, 79, 100, 27)
            ]
        )

    def rays(self, B, N, R=32):
        y, x = torch.meshgrid(torch.arange(R), torch.arange(R), indexing="ij")
        d = (
            torch.stack([(x - 16.1) / 128.36, -(y - 16.5) / 128.36, -torch.ones(R, R)], -1)
            .view(-1, 3)
            .float()
        )
        t = torch.linspace(9.5, 15.5, N + 1)
        p = torch.tensor([0.0, 0.0, 12.0]) + d[:, None] * t[None, :N, None]
        return p.view(1, R * R * N, 3).expand(B, -1, -1), torch.full((N,), 6.0 / N)

    def forward(self, z, N, with_weights=False):
        zi, ze, zt, zl = [m(v) for m, v in zip(self.map, z)]
        ws, wa = torch.cat([zi, ze], -1), torch.cat([zt, zl], -1)
        B = ws.shape[0]
        p, dl = self.rays(B, N)
        sg, r = self.nerf(p, ws)
        sg = sg.view(B, 1024, N)
        tau = sg * dl
        T = torch.exp(-(torch.cumsum(tau, -1) - tau))
        w = T * (1 - torch.exp(-tau))
        f = torch.einsum("brn,brnk->brk", w, r.view(B, 1024, N, -1))
        x = f.transpose(1, 2).reshape(B, -1, 32, 32)
        rgb = None
        outs = []
        for b in self.blocks:
            x, rgb = b(x, wa, rgb)
            outs.append(rgb)
        depths = torch.linspace(9.5, 15.5, N + 1)[:N]
        return (outs, w, depths) if with_weights else outs


class Lpips(nn.Module):
    def __init__(self, network="vgg16"):
        super().__init__()
        import torchvision

        self.f = getattr(torchvision.models, network)(weights=None).features.eval()
        for p in self.parameters():
            p.requires_grad_(False)
        self.taps = {"vgg16": {3, 8, 15, 22, 29}, "squeezenet1_1": {1, 4, 7, 9, 10, 11, 12}}
        self.taps = self.taps[network]

    def feats(self, x):
        o = []
        for i, l in enumerate(self.f):
            x = l(x)
            if i in self.taps:
                o.append(x / (x.pow(2).sum(1, keepdim=True).sqrt() + 1e-10))
            if i == max(self.taps):
                break
        return o

    def forward(self, fx, fy):
        return sum(((a - b) ** 2).mean() for a, b in zip(fx, fy))


class Bottleneck(nn.Module):
    def __init__(self, cin, cout, stride, t):
        super().__init__()
        c = cin * t
        self.f = nn.Sequential(
            *(nn.Conv2d(cin, c, 1, bias=False), nn.BatchNorm2d(c), nn.PReLU(c)),
            *(nn.Conv2d(c, c, 3, stride, 1, groups=c, bias=False), nn.BatchNorm2d(c), nn.PReLU(c)),
            *(nn.Conv2d(c, cout, 1, bias=False), nn.BatchNorm2d(cout)),
        )
        self.adds = stride == 1 and cin == cout

    def forward(self, x):
        return x + self.f(x) if self.adds else self.f(x)


class Encoder(nn.Module):
    """MobileFaceNet (Chen et al. 2018) on 112x112 pixels, then a head for each group of codes. The
    statistics of batch normalisation are constants, as in stymo."""

    def __init__(self):
        super().__init__()
        conv = lambda i, o, k, s, p, g: [
            nn.Conv2d(i, o, k, s, p, groups=g, bias=False),
            nn.BatchNorm2d(o),
        ]
        layers = [*conv(3, 64, 3, 2, 1, 1), nn.PReLU(64), *conv(64, 64, 3, 1, 1, 64), nn.PReLU(64)]
        cin = 64
        table = [(2, 64, 5, 2), (4, 128, 1, 2), (2, 128, 6, 1), (4, 128, 1, 2), (2, 128, 2, 1)]
        for t, c, n, s in table:
            for i in range(n):
                layers.append(Bottleneck(cin, c, s if i == 0 else 1, t))
                cin = c
        layers += [*conv(128, 512, 1, 1, 0, 1), nn.PReLU(512), *conv(512, 512, 7, 1, 0, 512)]
        layers += [*conv(512, 128, 1, 1, 0, 1), nn.Flatten()]
        self.backbone = nn.Sequential(*layers).eval()
        self.heads = nn.ModuleList([nn.Linear(128, d) for d in (100, 79, 100, 27)])

    def forward(self, x):
        x = F.interpolate(x, size=112, mode="bilinear", align_corners=False)
        e = 0.3 * F.normalize(self.backbone(x))
        return [h(e) for h in self.heads]


CHANNELS = {"celeba-64": [64], "celeba-128": [64, 32], "celeba-256": [64, 32, 32]}
WEIGHTS = {"celeba-64": [1.0], "celeba-128": [0.1, 1.0], "celeba-256": [0.05, 0.2, 1.0]}


def training_step(name):
    """A stage-1 step of configs/`name`.json as a function without arguments."""
    res, B, N = int(name.split("-")[1]), 8, 16
    E, G = Encoder(), Decoder(64, 4, res, 64, CHANNELS[name], 6)
    L = Lpips("squeezenet1_1")
    parameters = [*E.parameters(), *G.parameters()]
    average = [p.detach().clone() for p in parameters]
    opt = torch.optim.Adam(parameters, lr=2e-3)
    photos = torch.rand(B, 3, res, res) * 2 - 1
    mask = (torch.rand(B, 1024) > 0.5).float()

    def step():
        targets = [
            F.interpolate(photos, size=2**k, mode="area") if 2**k < res else photos
            for k in range(6, int(math.log2(res)) + 1)
        ]
        opt.zero_grad()
        outs, weights, depths = G(E(photos), N, True)
        loss = sum(g * (x - t).abs().mean() for g, x, t in zip(WEIGHTS[name], outs, targets))
        with torch.no_grad():
            wanted = L.feats(photos)
        loss = loss + 0.1 * L(L.feats(outs[-1]), wanted)
        opacity = weights.sum(-1)
        mean = (weights * depths).sum(-1, keepdim=True)
        variance = (weights * (depths - mean) ** 2).sum(-1).mean()
        loss = loss + 0.2 * ((opacity - mask) ** 2).mean() + 0.2 * variance
        loss.backward()
        opt.step()
        with torch.no_grad():
            torch._foreach_lerp_(average, parameters, 0.01) if hasattr(
                torch, "_foreach_lerp_"
            ) else [a.lerp_(p, 0.01) for a, p in zip(average, parameters)]

    return step


class Disc(nn.Module):
    """StyleGAN2 residual discriminator, channel multiplier 2."""

    def __init__(self, res):
        super().__init__()
        ch = lambda r: {4: 512, 8: 512, 16: 512, 32: 512, 64: 512, 128: 256, 256: 128, 512: 64}[r]
        self.rgb = nn.Conv2d(3, ch(res), 1)
        self.b = nn.ModuleList()
        r = res
        k = torch.tensor([1.0, 3.0, 3.0, 1.0])
        self.register_buffer("k", (k[:, None] * k[None] / 64)[None, None])
        while r > 4:
            i, o = ch(r), ch(r // 2)
            self.b.append(
                nn.ModuleList(
                    [
                        nn.Conv2d(i, i, 3, padding=1),
                        nn.Conv2d(i, o, 3, stride=2),
                        nn.Conv2d(i, o, 1, stride=2, bias=False),
                    ]
                )
            )
            r //= 2
        self.c = nn.Conv2d(513, 512, 3, padding=1)
        self.f = nn.Linear(8192, 512)
        self.o = nn.Linear(512, 1)

    def blur(self, x, p):
        return F.conv2d(
            F.pad(x, (p, p, p, p)), self.k.expand(x.shape[1], 1, 4, 4), groups=x.shape[1]
        )

    def forward(self, x):
        a = lambda v: F.leaky_relu(v, 0.2) * math.sqrt(2)
        x = a(self.rgb(x))
        for c1, c2, sk in self.b:
            x = (a(c2(self.blur(a(c1(x)), 2))) + sk(self.blur(x, 1))) / math.sqrt(2)
        B = x.shape[0]
        g = min(B, 4)
        s = x.view(g, B // g, *x.shape[1:])
        s = (s.var(0, unbiased=False) + 1e-8).sqrt().mean((1, 2, 3))
        x = torch.cat([x, s.repeat(g)[:, None, None, None].expand(B, 1, 4, 4)], 1)
        return self.o(a(self.f(a(self.c(x)).flatten(1))))


def timed(f, n):
    f()
    ts = []
    for _ in range(n):
        t = time.perf_counter()
        f()
        ts.append(time.perf_counter() - t)
    return sorted(ts)[len(ts) // 2]


def main():
    a = argparse.ArgumentParser()
    a.add_argument("what", nargs="+")
    a.add_argument("--threads", type=int, default=2)
    a.add_argument("--width", type=int, default=256)
    a.add_argument("--layers", type=int, default=8)
    a.add_argument("--samples", type=int, default=64)
    a.add_argument("--res", type=int, default=512)
    a.add_argument("--batch", type=int, default=1)
    a.add_argument("-n", type=int, default=3)
    o = a.parse_args()
    torch.set_num_threads(o.threads)
    torch.manual_seed(0)
    for w in [w for w in o.what if w in CHANNELS]:
        time_of_step = timed(training_step(w), o.n)
        print(f"{w}: {time_of_step * 1e3:.1f} ms  (threads {o.threads}, batch 8)", flush=True)
    o.what = [w for w in o.what if w not in CHANNELS]
    G = Decoder(o.width, o.layers, o.res)
    z = [torch.randn(o.batch, d) * 0.1 for d in (100, 79, 100, 27)]
    tgt = torch.rand(o.batch, 3, o.res, o.res) * 2 - 1
    tg = [
        F.interpolate(tgt, size=2**k, mode="bicubic", antialias=True) if 2**k < o.res else tgt
        for k in range(6, int(math.log2(o.res)) + 1)
    ]
    gam = [0.01, 0.1, 0.5, 1.0][-len(tg) :]
    for w in o.what:
        if w.startswith("render"):

            def f():
                with torch.no_grad(), torch.autocast("cpu", torch.bfloat16, "bfloat16" in w):
                    G(z, o.samples)

        elif w in ("disc", "r1"):
            D = Disc(o.res)
            x = torch.rand(o.batch, 3, o.res, o.res)
            opt = torch.optim.Adam(D.parameters(), lr=1e-4, betas=(0.0, 0.99))

            def f():
                opt.zero_grad()
                xr = x.clone().requires_grad_(w == "r1")
                d = D(xr)
                if w == "r1":
                    (g,) = torch.autograd.grad(d.sum(), xr, create_graph=True)
                    loss = 5 * g.pow(2).flatten(1).sum(1).mean()
                else:
                    loss = F.softplus(-d).mean()
                loss.backward()
                opt.step()

        elif w.startswith("fit") or w.startswith("train"):
            train = w.startswith("train")
            N = 32 if train else o.samples
            for p in G.parameters():
                p.requires_grad_(train)
            dz = [torch.zeros_like(v, requires_grad=True) for v in z]
            opt = torch.optim.Adam(G.parameters() if train else dz, lr=1e-4 if train else 1e-2)
            L = Lpips() if "lpips" in w else None
            ft = None
            if L and not train:
                with torch.no_grad():
                    ft = L.feats(tgt)

            def f():
                feats = ft
                opt.zero_grad()
                outs = G([v + d for v, d in zip(z, dz)], N)
                loss = sum(g * (x - t).abs().mean() for g, x, t in zip(gam, outs, tg))
                if L:
                    if train:  # another target in every step: its features are part of the step
                        with torch.no_grad():
                            feats = L.feats(tgt)
                    loss = loss + 0.1 * L(L.feats(outs[-1]), feats)
                loss = loss + sum((d**2).sum() for d in dz)
                loss.backward()
                opt.step()

        print(
            f"{w}: {timed(f, o.n) * 1e3:.1f} ms  (threads {o.threads}, N {o.samples}, "
            f"width {o.width}x{o.layers}, res {o.res}, batch {o.batch})",
            flush=True,
        )


if __name__ == "__main__":
    main()
