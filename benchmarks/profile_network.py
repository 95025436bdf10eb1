"""Where a training step and an inference of TAPSR's network spend their time, operation by operation.

PYTHONPATH=. OMP_NUM_THREADS=1 python benchmarks/profile_network.py
"""

import torch
from torch.profiler import ProfilerActivity, profile

import pcsr
from pcsr import TouchBatch

BATCH, POINTS, RATE, TOUCHES = 8, 512, 16, 4


def main():
    network = pcsr.load("tapsr").network
    torch.manual_seed(0)
    points, touches = torch.rand(BATCH, POINTS, 3), torch.rand(BATCH, TOUCHES, POINTS, 3)

    def inference():
        with torch.inference_mode():
            network(points[:1], RATE, TouchBatch.of(touches[:1]))

    def step():
        network(points, RATE, TouchBatch.of(touches)).mean().backward()

    for name, run in (("inference", inference), ("training step", step)):
        run()
        with profile(activities=[ProfilerActivity.CPU]) as found:
            for _ in range(3):
                run()
        print(name)  # noqa: T201
        print(found.key_averages().table(sort_by="self_cpu_time_total", row_limit=12))  # noqa: T201


if __name__ == "__main__":
    main()
