// SPDX-License-Identifier: Apache-2.0

#include "pipeline/base/memory_limit.h"

#include <sys/resource.h>
#include <unistd.h>

#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <algorithm>
#include <fstream>
#include <limits>
#include <string>

namespace sonocase::pipeline::inline base {
namespace {

double lowest_mb = std::numeric_limits<double>::infinity();  // of all MemoryLimits

}  // namespace

double machine_memory_mb() {
    double limit = std::numeric_limits<double>::infinity();
    const long pages = sysconf(_SC_PHYS_PAGES), page = sysconf(_SC_PAGESIZE);
    if (pages > 0 && page > 0) limit = static_cast<double>(pages) * static_cast<double>(page) / 1e6;
    // Version 2 of control groups names one path below its root; "max" means no limit.
    std::ifstream groups("/proc/self/cgroup");
    std::string line, path;
    while (std::getline(groups, line)) {
        if (line.starts_with("0::/")) path = line.substr(3);
    }
    while (!path.empty()) {
        std::ifstream file("/sys/fs/cgroup" + path + "/memory.max");
        double bytes = 0;
        if (file >> bytes) limit = std::min(limit, bytes / 1e6);
        path.resize(path == "/" ? 0 : path.rfind('/'));
    }
    for (const int of : {RLIMIT_AS, RLIMIT_DATA}) {  // ulimit -v, -d
        rlimit allowed{};
        if (getrlimit(static_cast<decltype(RLIMIT_AS)>(of), &allowed) == 0 &&
            allowed.rlim_cur != RLIM_INFINITY)
            limit = std::min(limit, static_cast<double>(allowed.rlim_cur) / 1e6);
    }
    return limit;
}

double memory_limit_mb() {
    return std::min(lowest_mb, machine_memory_mb());
}

void give_memory_back() {
#ifdef __GLIBC__
    malloc_trim(0);
#endif
}

MemoryLimit::MemoryLimit(double mb) : before_mb_(lowest_mb) {
    if (mb > 0) lowest_mb = std::min(lowest_mb, mb);
}

MemoryLimit::~MemoryLimit() {
    lowest_mb = before_mb_;
}

}  // namespace sonocase::pipeline::inline base
