#include "formats/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <new>

namespace sonocase {
namespace {

class Descriptor {
  public:
    explicit Descriptor(int fd) : fd_(fd) {}
    ~Descriptor() {
        if (fd_ >= 0) ::close(fd_);
    }
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    int get() const { return fd_; }
    bool close() {
        const int fd = fd_;
        fd_ = -1;
        return ::close(fd) == 0;
    }

  private:
    int fd_;
};

std::string reason(const char* doing, int fault) {
    return std::string(doing) + ": " + std::strerror(fault);
}

template <class Bytes>
Result<Bytes> read_whole(const std::string& path) {
    const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
    if (file.get() < 0) return Error{reason("cannot open", errno), path, ""};
    struct stat status {};
    if (::fstat(file.get(), &status) != 0) return Error{reason("cannot read", errno), path, ""};
    if (S_ISDIR(status.st_mode)) return Error{"is a folder", path, "name a file"};
    Bytes bytes;
    std::size_t filled = 0;
    try {
        bytes.resize(static_cast<std::size_t>(status.st_size) + 1);  // one more, to see the end
        while (true) {
            if (filled == bytes.size()) bytes.resize(2 * bytes.size());
            const ssize_t n = ::read(file.get(), bytes.data() + filled, bytes.size() - filled);
            if (n < 0 && errno == EINTR) continue;
            if (n < 0) return Error{reason("cannot read", errno), path, ""};
            if (n == 0) break;
            filled += static_cast<std::size_t>(n);
        }
        bytes.resize(filled);
    } catch (const std::bad_alloc&) {
        return Error{"is too large for the memory", path, ""};
    }
    return bytes;
}

bool write_all(int fd, std::span<const std::uint8_t> bytes) {
    while (!bytes.empty()) {
        const ssize_t n = ::write(fd, bytes.data(), bytes.size());
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) return false;
        bytes = bytes.subspan(static_cast<std::size_t>(n));
    }
    return true;
}

std::string folder_of(const std::string& path) {
    const std::size_t slash = path.rfind('/');
    if (slash == std::string::npos) return ".";
    return slash == 0 ? "/" : path.substr(0, slash);
}

}  // namespace

Result<std::vector<std::uint8_t>> read_file(const std::string& path) {
    return read_whole<std::vector<std::uint8_t>>(path);
}

Result<std::string> read_text_file(const std::string& path) {
    return read_whole<std::string>(path);
}

Status write_file(const std::string& path, std::span<const std::uint8_t> bytes) {
    // Process and count, so that two writers of the same path never share a temporary file.
    static std::atomic<unsigned> count{0};
    const std::string temporary =
        path + ".part-" + std::to_string(::getpid()) + "-" + std::to_string(count++);
    Descriptor file(::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
    if (file.get() < 0) {
        return Error{reason("cannot write", errno), path,
                     "check that the folder exists and is writable"};
    }
    const auto give_up = [&](int fault) -> Status {
        ::unlink(temporary.c_str());
        return Error{reason("cannot write", fault), path, "nothing was written"};
    };
    if (!write_all(file.get(), bytes)) return give_up(errno);
    if (::fsync(file.get()) != 0 && errno != EINVAL && errno != EROFS) return give_up(errno);
    if (!file.close()) return give_up(errno);
    if (::rename(temporary.c_str(), path.c_str()) != 0) return give_up(errno);
    // The new name reaches the disk with its folder; failing to flush that is not a failed write.
    const Descriptor folder(::open(folder_of(path).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (folder.get() >= 0) (void)::fsync(folder.get());
    return Done{};
}

Status write_file(const std::string& path, std::string_view text) {
    return write_file(path,
                      std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
}

}  // namespace sonocase
