"""Days and cost of a training on several machines, by the model of docs/studies/scaling.md.

Seconds for an image on one node, parameters in millions and the network are arguments, so that
other machines can be put in. usage: scaling_model.py [--image 2.9] [--image-512 8.7] ...
"""

import argparse
import math


def exchange(nodes, bytes_sent, o):
    """Seconds to add up a message over all nodes: in halves for a power of two, else along a
    tree."""
    if nodes == 1:
        return 0.0
    rounds = 2 * math.ceil(math.log2(nodes))
    if nodes & (nodes - 1) == 0:
        volume = 2 * (nodes - 1) / nodes * bytes_sent
    else:
        volume = rounds * bytes_sent
    return volume / o.bandwidth + rounds * o.latency


def row(name, nodes, batch, steps, image, bytes_sent, o):
    compute = batch / nodes * image
    network = exchange(nodes, bytes_sent, o)
    days = steps * (compute + network) / 86400
    cost = days * 24 * nodes * o.cores * o.price
    share = compute / (compute + network)
    print(
        f"| {name} | {nodes} | {batch} | {compute + network:.2f} | {100 * share:.0f} % "
        f"| {days:.1f} | {cost:.0f} |"
    )


def main():
    a = argparse.ArgumentParser()
    a.add_argument("--image", type=float, default=2.9, help="seconds for an image of stage 1")
    a.add_argument("--image-512", type=float, default=8.7, help="the same in stage 2 at 512 pixels")
    a.add_argument("--generator", type=float, default=1.64, help="parameters in millions")
    a.add_argument("--encoder", type=float, default=45.28)
    a.add_argument("--discriminator", type=float, default=28.99)
    a.add_argument("--bandwidth", type=float, default=1.25e9, help="bytes per second, each way")
    a.add_argument("--latency", type=float, default=50e-6, help="seconds for a message")
    a.add_argument("--cores", type=int, default=2, help="of a node")
    a.add_argument("--price", type=float, default=0.05, help="of a core for an hour")
    o = a.parse_args()
    stage1 = 4e6 * (o.generator + o.encoder)
    stage2 = 4e6 * (o.generator + o.discriminator * (1 + 1 / 16))
    print("| phase | nodes | batch | seconds a step | of it computing | days | cost |")
    print("|---|---|---|---|---|---|---|")
    for nodes in (1, 8, 32):
        row("stage 1", nodes, 32, 200000, o.image, stage1, o)
    for nodes in (64, 512):
        row("stage 1, larger batch", nodes, nodes, 200000 * 32 // nodes, o.image, stage1, o)
    for nodes in (1, 6, 12):
        row("stage 2 at 512", nodes, 12, 500000 // 12, o.image_512, stage2, o)
    for nodes in (64, 512):
        row("stage 2 at 512, larger batch", nodes, nodes, 500000 // nodes, o.image_512, stage2, o)


main()
