"""Every build writes the bytes that tests/digests.sh found to be those of all compilers and instruction sets."""

import unittest

import digest_matrix
from program import PROGRAM, ProgramTest

# Slices and voxels of each chain. A change that is meant to change them records them anew: the failing test shows them.
GOLDEN = {"colour": "4dca84d277c0f9966752f1739e1534117c1cce59da5c50c803c3dfa539d744ef",
          "masks": "fcff556253ddf0c2347d3afdcf22f8d3e9045ef5493d6dbaff16124772434e81"}

SETTINGS = (("best", "fused", 8, 1), ("best", "piped", "all", 2), ("baseline", "fused", 24, 4), ("baseline", "filed", 8, 2))


class Digests(ProgramTest):
    def assert_golden(self, chain):
        runs = {kind: digest_matrix.Runs(PROGRAM, kind, self.folder / kind) for kind in digest_matrix.INSTRUCTIONS}
        found = {setting: runs[setting[0]].digests(chain, *setting[1:]) for setting in SETTINGS}
        self.assertEqual(len(set(found.values())), 1, found)
        self.assertEqual(next(iter(found.values()))[1], GOLDEN[chain])

    def test_a_coloured_part_has_the_recorded_slices_and_voxels(self):
        self.assert_golden("colour")

    def test_masks_and_shells_have_the_recorded_slices_and_voxels(self):
        self.assert_golden("masks")


if __name__ == "__main__":
    unittest.main()
