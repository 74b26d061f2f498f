#include "pipeline/files.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

namespace sonocase::pipeline {
namespace {

namespace fs = std::filesystem;

struct CloseFile {
    void operator()(std::FILE* file) const { std::fclose(file); }
};
using FilePointer = std::unique_ptr<std::FILE, CloseFile>;

Error system_error(const std::string& doing, const std::string& path, const std::string& todo) {
    return {doing + ": " + std::strerror(errno), path, todo};
}

// Unlike any other name in use: by this process (counter), on this machine (process number), and,
// with a folder shared by machines, anywhere (host name).
std::string temporary_name(const std::string& path) {
    static std::atomic<unsigned> counter{0};
    char host[64] = "host";
    gethostname(host, sizeof host - 1);
    const fs::path whole(path);
    std::string name = whole.filename().string();
    const std::string ending =
        name.size() > 7 && name.ends_with(".nii.gz") ? ".nii.gz" : whole.extension().string();
    name = "." + name + "." + host + "." + std::to_string(getpid()) + "." +
           std::to_string(counter++) + ".tmp" + ending;
    return (whole.parent_path() / name).string();
}

// Whether temporary_name made it: ".NAME.HOST.PID.COUNT.tmp", an ending perhaps.
bool is_temporary_name(const std::string& name) {
    const std::size_t tmp = name.rfind(".tmp");
    if (!name.starts_with('.') || tmp == std::string::npos || tmp < 2) return false;
    const std::size_t dot = name.rfind('.', tmp - 1);
    return dot != std::string::npos && dot + 1 < tmp &&
           std::all_of(name.begin() + static_cast<std::ptrdiff_t>(dot) + 1,
                       name.begin() + static_cast<std::ptrdiff_t>(tmp),
                       [](unsigned char c) { return std::isdigit(c) != 0; });
}

// Closes on destruction, which gives the lock back.
class Lock {
  public:
    explicit Lock(int fd) : fd_(fd) {}
    ~Lock() {
        if (fd_ >= 0) ::close(fd_);
    }
    Lock(const Lock&) = delete;
    Lock& operator=(const Lock&) = delete;

  private:
    int fd_;
};

// Opens a temporary and locks it against remove_leftovers, which may have taken it in between: the
// file then has no name any more, and another is made.
FilePointer open_locked(const std::string& path) {
    for (;;) {
        FilePointer file(std::fopen(path.c_str(), "wbe"));
        if (!file) return file;
        // A file system without locks: remove_leftovers goes by age there.
        if (::flock(::fileno(file.get()), LOCK_EX) != 0) return file;
        struct stat status {};
        if (::fstat(::fileno(file.get()), &status) != 0 || status.st_nlink > 0) return file;
    }
}

}  // namespace

Result<std::vector<std::uint8_t>> read_file(const std::string& path) {
    std::error_code code;
    if (!fs::exists(path, code)) return Error{"no such file", path, "check the path"};
    if (fs::is_directory(path, code)) return Error{"is a folder", path, "expected a file"};
    FilePointer file(std::fopen(path.c_str(), "rb"));
    if (!file) return system_error("cannot open", path, "check that it may be read");
    std::vector<std::uint8_t> bytes;
    std::uint8_t buffer[1 << 16];
    for (;;) {
        const std::size_t n = std::fread(buffer, 1, sizeof buffer, file.get());
        bytes.insert(bytes.end(), buffer, buffer + n);
        if (n < sizeof buffer) break;
    }
    if (std::ferror(file.get())) return system_error("cannot read", path, "check the disk");
    return bytes;
}

Result<std::string> read_text_file(const std::string& path) {
    auto bytes = read_file(path);
    if (!bytes) return bytes.error();
    return std::string(bytes->begin(), bytes->end());
}

Status write_file(const std::string& path, std::span<const std::uint8_t> bytes) {
    std::error_code code;
    const bool special =
        fs::exists(path, code) && !fs::is_regular_file(path, code) && !fs::is_directory(path, code);
    if (special || path.starts_with("/dev/") || path.starts_with("/proc/")) {
        // A pipe or a device, or /dev/stdout, which may lead to a file: renaming would replace it.
        FilePointer file(std::fopen(path.c_str(), "ab"));
        if (!file || std::fwrite(bytes.data(), 1, bytes.size(), file.get()) != bytes.size() ||
            std::fflush(file.get()) != 0)
            return system_error("cannot write", path, "check that it may be written");
        return Done{};
    }
    OutputFile output(path);
    FilePointer file = open_locked(output.temporary());
    if (!file) return system_error("cannot write", path, "check that the folder may be written");
    // The lock lives on in the copy until the file has its name.
    const Lock lock(::fcntl(::fileno(file.get()), F_DUPFD_CLOEXEC, 0));
    const bool written =
        bytes.empty() || std::fwrite(bytes.data(), 1, bytes.size(), file.get()) == bytes.size();
    if (!written || std::fclose(file.release()) != 0)
        return system_error("cannot write", path, "check the free space");
    return output.commit();
}

Status write_text_file(const std::string& path, std::string_view text) {
    return write_file(path, {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
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
        const int fd = ::open(it->path().c_str(), O_RDONLY | O_CLOEXEC);
        if (fd < 0) continue;
        const Lock lock(fd);
        if (::flock(fd, LOCK_EX | LOCK_NB) != 0) {
            if (errno == EWOULDBLOCK) continue;
            const auto touched = it->last_write_time(item_code);
            if (item_code || now - touched < std::chrono::hours(1)) continue;
        }
        if (fs::remove(it->path(), item_code)) ++removed;
    }
    return removed;
}

OutputFile::OutputFile(std::string path)
    : path_(std::move(path)), temporary_(temporary_name(path_)) {
    std::error_code code;  // a folder that cannot be made shows when the file is opened
    const fs::path parent = fs::path(path_).parent_path();
    if (!parent.empty()) fs::create_directories(parent, code);
}

OutputFile::~OutputFile() {
    if (!committed_) std::remove(temporary_.c_str());
}

Status OutputFile::commit() {
    if (std::rename(temporary_.c_str(), path_.c_str()) != 0)
        return system_error("cannot write", path_, "check that the folder may be written");
    committed_ = true;
    return Done{};
}

}  // namespace sonocase::pipeline
