"""The table of all turns in the ledger: inputs, how they ended, and the time they took.

python -m experiments.fuzzing.totals          from the root of the repository
"""

import json
from collections import Counter, defaultdict

from experiments.fuzzing.fuzz import GOOD, LEDGER


def main() -> None:
    """Print a row a format and its failures."""
    rows = [json.loads(line) for line in LEDGER.read_text().splitlines()]
    outcomes, seconds = defaultdict(Counter[str]), Counter[str]()
    for row in rows:
        outcomes[row["key"]].update(row["outcomes"])
        seconds[row["key"]] += row["seconds"]
    print("| format | inputs | read | refused | failures | minutes |\n|---|---|---|---|---|---|")
    for key, counts in outcomes.items():
        good = [counts[what] for what in GOOD]
        cells = [key, counts.total(), *good, counts.total() - sum(good), f"{seconds[key] / 60:.1f}"]
        print("| " + " | ".join(map(str, cells)) + " |")
    for key, counts in outcomes.items():
        for what, n in counts.items():
            if what not in GOOD:
                print(f"{key}: {n}x {what}")
    print("commits:", *dict.fromkeys(row["commit"] for row in rows), "seeds:", *sorted({row["seed"] for row in rows}))


if __name__ == "__main__":
    main()
