"""Watches the memory and the open files of a process. Used by the long_*.py scripts."""
import os
import pathlib


class Watch:
    """Rows of (work done, resident KiB, open files), of which every twentieth part is printed."""

    def __init__(self, pid: int, what: str, total: int):
        self.pid, self.total, self.printed = pid, total, 0
        self.rows: list[tuple[int, int, int]] = []
        print(f"| {what} | resident, MiB | open files |\n|---|---|---|", flush=True)

    def look(self, done: int) -> bool:
        """Adds a row if more work is done than before. False: the process has ended."""
        try:
            if done > 0 and (not self.rows or done > self.rows[-1][0]):
                row = (done, resident_kib(self.pid), len(os.listdir(f"/proc/{self.pid}/fd")))
                self.rows.append(row)
                if done * 20 // self.total > self.printed:
                    self.printed = done * 20 // self.total
                    print(f"| {done} | {row[1] / 1024:.1f} | {row[2]} |", flush=True)
            return True
        except (FileNotFoundError, ProcessLookupError):
            return False

    def is_flat(self, begin: int, most_percent: float = 1.0) -> bool:
        """Prints how memory and open files changed once `begin` was done; false if either grew.

        Memory may be `most_percent` more than in the first tenth. A file that is being written is
        open for a moment; a leak raises the fewest ones."""
        warm = [row for row in self.rows if row[0] >= begin]
        part = max(1, len(warm) // 10)
        early = max(kib for _, kib, _ in warm[:part])
        late = max(kib for _, kib, _ in warm)
        print(f"largest resident memory: {early} KiB in the first tenth after {begin}, {late} KiB "
              f"in all ({100 * (late / early - 1):.2f} % more)")
        files = [count for _, _, count in warm]
        print(f"open files: {min(files)} to {max(files)}")
        return late <= (1 + most_percent / 100) * early and min(files[-part:]) <= min(files[:part])


def resident_kib(pid: int) -> int:
    for line in pathlib.Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1])
    return 0
