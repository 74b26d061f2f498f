// SPDX-License-Identifier: Apache-2.0

#include "formats/files/atomic_file.h"

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <new>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "formats/base/digest.h"

namespace sonocase {
namespace {

namespace fs = std::filesystem;

// Closes the file on destruction, which releases its lock.
class Descriptor {
  public:
    explicit Descriptor(int fd) : fd_(fd) {}
    ~Descriptor() { close(); }
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    int get() const { return fd_; }
    void open(const std::string& path, int flags) {
        close();
        fd_ = ::open(path.c_str(), flags | O_CLOEXEC, 0666);
    }
    void close() {
        if (fd_ >= 0) ::close(fd_);
        fd_ = -1;
    }

  private:
    int fd_;
};

Error system_error(const char* doing, int fault, const std::string& path, const char* expected) {
    if (fault == ENOENT) return {"no such file", path, "check the path"};
    return {Message(doing, {std::strerror(fault)}), path, expected};
}

template <class Bytes>
Result<Bytes> read_whole(const std::string& path) {
    SONOCASE_TRY_DONE(expect_regular_file(path));
    const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
    if (file.get() < 0)
        return system_error("cannot open: {}", errno, path, "check that it may be read");
    struct stat status {};
    if (::fstat(file.get(), &status) != 0)
        return system_error("cannot read: {}", errno, path, "check the disk");
    Bytes bytes;
    std::size_t filled = 0;
    try {
        bytes.resize(static_cast<std::size_t>(status.st_size) + 1);  // one more, to see the end
        while (true) {
            if (filled == bytes.size()) bytes.resize(2 * bytes.size());
            const ssize_t n = ::read(file.get(), bytes.data() + filled, bytes.size() - filled);
            if (n < 0 && errno == EINTR) continue;
            if (n < 0) return system_error("cannot read: {}", errno, path, "check the disk");
            if (n == 0) break;
            filled += static_cast<std::size_t>(n);
        }
        bytes.resize(filled);
    } catch (const std::bad_alloc&) {
        return Error{"does not fit into memory", path, ""};
    }
    return bytes;
}

bool write_all(int fd, std::span<const std::uint8_t> bytes) {
    while (!bytes.empty()) {
        const ssize_t n = ::write(fd, bytes.data(), bytes.size());
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) return false;
        bytes = bytes.subspan(n);
    }
    return true;
}

// Whether the path leads to a pipe or device, or is /dev/stdout or the like, which may lead to a
// file: renaming would replace it.
bool is_special(const std::string& path) {
    struct stat status {};
    const bool exists = ::stat(path.c_str(), &status) == 0;
    return (exists && !S_ISREG(status.st_mode) && !S_ISDIR(status.st_mode)) ||
           path.starts_with("/dev/std") || path.starts_with("/dev/fd/") ||
           path.starts_with("/proc/");
}

// A name that is unique within this process (counter), on this machine (process number), and in a
// folder shared by machines (host name).
std::string temporary_name(const std::string& path) {
    static std::atomic<unsigned> counter{0};
    char host[64] = "host";
    ::gethostname(host, sizeof host - 1);
    const fs::path whole(path);
    std::string name = whole.filename().string();
    const std::string ending =
        name.size() > 7 && name.ends_with(".nii.gz") ? ".nii.gz" : whole.extension().string();
    name = "." + name + "." + host + "." + std::to_string(::getpid()) + "." +
           std::to_string(counter++) + ".tmp" + ending;
    return (whole.parent_path() / name).string();
}

// Whether the name was made by temporary_name: ".NAME.HOST.PID.COUNT.tmp", perhaps with an ending.
bool is_temporary_name(const std::string& name) {
    const std::size_t tmp = name.rfind(".tmp");
    if (!name.starts_with('.') || tmp == std::string::npos || tmp < 2) return false;
    const std::size_t dot = name.rfind('.', tmp - 1);
    return dot != std::string::npos && dot + 1 < tmp &&
           std::all_of(name.begin() + static_cast<std::ptrdiff_t>(dot) + 1,
                       name.begin() + static_cast<std::ptrdiff_t>(tmp),
                       [](unsigned char c) { return std::isdigit(c) != 0; });
}

// Opens a temporary and locks it against remove_leftovers, which may have removed it in between:
// the file then has no name, and another is created.
bool open_locked(const std::string& path, Descriptor* file) {
    for (;;) {
        file->open(path, O_WRONLY | O_CREAT | O_TRUNC);
        if (file->get() < 0) return false;
        // Without locks in this file system, remove_leftovers goes by age.
        if (::flock(file->get(), LOCK_EX) != 0) return true;
        struct stat status {};
        if (::fstat(file->get(), &status) != 0 || status.st_nlink > 0) return true;
    }
}

// Puts the new name on disk; if that fails, the write still succeeded.
void flush_folder_of(const std::string& path) {
    const fs::path parent = fs::path(path).parent_path();
    const Descriptor folder(
        ::open(parent.empty() ? "." : parent.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (folder.get() >= 0) (void)::fsync(folder.get());
}

}  // namespace

Status expect_regular_file(const std::string& path, const std::string& expected) {
    struct stat status {};
    if (::stat(path.c_str(), &status) != 0)
        return system_error("cannot open: {}", errno, path, "check that it may be read");
    const char* what = S_ISREG(status.st_mode)    ? nullptr
                       : S_ISDIR(status.st_mode)  ? "is a folder"
                       : S_ISFIFO(status.st_mode) ? "is a pipe"
                       : S_ISSOCK(status.st_mode) ? "is a socket"
                                                  : "is a device";
    if (what != nullptr) return Error{what, path, expected};
    return Done{};
}

Result<std::vector<std::uint8_t>> read_file(const std::string& path) {
    return read_whole<std::vector<std::uint8_t>>(path);
}

Result<RawVector<std::uint8_t>> read_large_file(const std::string& path) {
    return read_whole<RawVector<std::uint8_t>>(path);
}

Result<std::string> read_text_file(const std::string& path) {
    return read_whole<std::string>(path);
}

Status write_file(const std::string& path, std::span<const std::uint8_t> bytes) {
    Descriptor file(-1);
    if (is_special(path)) {
        file.open(path, O_WRONLY | O_APPEND);
        if (file.get() < 0 || !write_all(file.get(), bytes))
            return system_error("cannot write: {}", errno, path, "check that it may be written");
        return Done{};
    }
    OutputFile output(path);
    if (!open_locked(output.temporary(), &file)) {
        int fault = errno;
        if (fault == ENOENT) {  // the folder could not be made: report why
            std::error_code code;
            fs::create_directories(fs::path(path).parent_path(), code);
            if (code) fault = code.value();
        }
        return Error{Message("cannot write: {}", {std::strerror(fault)}), path,
                     "check that the folder may be written"};
    }
    const bool written = write_all(file.get(), bytes) &&
                         (::fsync(file.get()) == 0 || errno == EINVAL || errno == EROFS);
    if (!written) {
        return Error{Message("cannot write: {}", {std::strerror(errno)}), path,
                     "nothing was written; check the free space"};
    }
    // The lock is held until the file has its name.
    SONOCASE_TRY_DONE(output.commit());
    flush_folder_of(path);
    return Done{};
}

Status write_file(const std::string& path, std::string_view text) {
    return write_file(path,
                      std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
}

Status expect_writable(const std::string& path) {
    std::error_code code;
    if (fs::is_directory(path, code)) return Error{"is a folder", path, "give the name of a file"};
    fs::path at = path;
    if (!fs::exists(at, code) || fs::is_regular_file(at, code)) {  // a new file takes its place
        do at = at.has_parent_path() && at != at.parent_path() ? at.parent_path() : fs::path(".");
        while (!fs::exists(at, code));
        if (!fs::is_directory(at, code))
            return Error{"is no folder", at.string(), "give a path through folders"};
    }
    const int rights = fs::is_directory(at, code) ? W_OK | X_OK : W_OK;
    if (::access(at.c_str(), rights) == 0) return Done{};
    return system_error("cannot write here: {}", errno, at.string(),
                        "give a place that you may write to");
}

OutputFile::OutputFile(std::string path)
    : path_(std::move(path)), temporary_(temporary_name(path_)) {
    std::error_code code;  // if the folder cannot be made, opening the file fails
    const fs::path parent = fs::path(path_).parent_path();
    if (!parent.empty()) fs::create_directories(parent, code);
}

OutputFile::~OutputFile() {
    if (!committed_) ::unlink(temporary_.c_str());
}

Status OutputFile::commit() {
    if (::rename(temporary_.c_str(), path_.c_str()) != 0) {
        if (errno == EISDIR) return Error{"is a folder", path_, "expected the name of a file"};
        return Error{Message("cannot write: {}", {std::strerror(errno)}), path_,
                     "check that the folder may be written"};
    }
    committed_ = true;
    return Done{};
}

std::size_t remove_leftovers(const std::string& folder) {
    std::size_t removed = 0;
    std::error_code code;
    const auto now = fs::file_time_type::clock::now();
    for (auto it = fs::recursive_directory_iterator(folder, code);
         !code && it != fs::recursive_directory_iterator(); it.increment(code)) {
        std::error_code item_code;
        if (!is_temporary_name(it->path().filename().string()) || !it->is_regular_file(item_code))
            continue;
        const Descriptor file(::open(it->path().c_str(), O_RDONLY | O_CLOEXEC));
        if (file.get() < 0) continue;
        if (::flock(file.get(), LOCK_EX | LOCK_NB) != 0) {
            if (errno == EWOULDBLOCK) continue;
            const auto touched = it->last_write_time(item_code);
            if (item_code || now - touched < std::chrono::hours(1)) continue;
        }
        if (fs::remove(it->path(), item_code)) ++removed;
    }
    return removed;
}

Result<std::string> digest_of_file(const std::string& path) {
    SONOCASE_TRY(const auto bytes, read_file(path));
    return digest_of(bytes);
}

}  // namespace sonocase
