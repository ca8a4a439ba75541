"""The decoder in a graph of PyTorch: a head in PyTorch optimises codes through it.

    python3 docs/examples/torch_decoder.py
"""
import torch

import stymo


class Decode(torch.autograd.Function):
    """codes (B, 306), float32 -> images (B, size, size, 3) in [-1, 1]; no memory is copied."""

    @staticmethod
    def forward(ctx, codes, model, angles, size):
        ctx.codes = stymo.Tensor(codes.detach().contiguous().numpy(), requires_grad=True)
        ctx.images = model.decode(ctx.codes, angles, size)
        return torch.from_dlpack(ctx.images)

    @staticmethod
    def backward(ctx, dL_dimages):
        dL_dcodes = stymo.grad(ctx.images, ctx.codes, dL_dimages.contiguous().numpy())
        return torch.from_dlpack(dL_dcodes), None, None, None


if __name__ == "__main__":
    model = stymo.Model.load()
    wanted, face = model.sample(2, seed=1)
    with torch.no_grad():
        target = Decode.apply(torch.tensor(wanted.codes)[None], model, None, 64)
    codes = torch.tensor(face.codes)[None].requires_grad_()
    optimizer = torch.optim.Adam([codes], lr=0.05)
    for step in range(20):
        optimizer.zero_grad()
        loss = torch.nn.functional.mse_loss(Decode.apply(codes, model, None, 64), target)
        loss.backward()
        optimizer.step()
        if step % 5 == 0:
            print(f"step {step}: loss {loss.item():.4f}")
