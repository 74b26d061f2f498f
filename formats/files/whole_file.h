// SPDX-License-Identifier: Apache-2.0

// Reads a file into memory and hands its bytes to a reader of formats/. Running out of memory
// becomes an Error. For the .cpp files of formats/files.
#pragma once

#include <new>
#include <string>
#include <utility>

#include "formats/files/atomic_file.h"

namespace sonocase::detail {

// read(bytes): a Result. The bytes are the reader's to keep. remedy: what to do about too little
// memory.
template <class Read>
auto read_whole(const std::string& path, const Read& read, const char* remedy = "")
    -> decltype(read(RawVector<std::uint8_t>())) {
    try {
        auto bytes = read_large_file(path);
        if (!bytes) return bytes.error();
        return read(std::move(*bytes));
    } catch (const std::bad_alloc&) {
        return Error{"needs more memory than is available", path, remedy};
    }
}

}  // namespace sonocase::detail
