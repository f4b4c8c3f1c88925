#pragma once

/// Prints a table in Markdown of what it costs to find the walls of many shells: in a row, within
/// each other, on one plane, face to face, in one place and as the rods of a lattice.
void printWallCosts();
