#pragma once

// Included first in builds with ThreadSanitizer. OpenVDB's tools are then compiled from their
// headers, with instrumentation. libopenvdb.so has none: ThreadSanitizer does not see the end of
// its loops and would report races between their threads and later code.

#include <openvdb/version.h>

#undef OPENVDB_USE_EXPLICIT_INSTANTIATION
