#pragma once

// Included before all else where ThreadSanitizer builds: OpenVDB's tools are then compiled from
// their headers, with its instruments. libopenvdb.so has none, so that loops which it holds
// compiled end unseen, and what one of their threads did seems to race with what comes after.

#include <openvdb/version.h>

#undef OPENVDB_USE_EXPLICIT_INSTANTIATION
