// SPDX-License-Identifier: Apache-2.0

// An author's signature of a case, in its file. Nobody needs one: it says that the case is as the
// holder of a key left it, to whoever knows that key's fingerprint. docs/format.md, part 10.
//
// Signed is what the chunks hold, not how they are packed or ordered, so that a published case
// keeps its signature. Ed25519 (RFC 8032) of a statement that lists the SHA-512 of each chunk.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/jobs.h"
#include "formats/base/result.h"

namespace sonocase {

using PublicKey = std::array<std::uint8_t, 32>;
struct SigningKey {
    std::array<std::uint8_t, 32> seed;  // RFC 8032's private key: whoever has it signs
};
PublicKey public_key_of(const SigningKey& key);
// What people compare: the first 16 bytes of the key's SHA-512, "1f2e 3d4c ...", 39 characters.
std::string fingerprint_of(const PublicKey& key);

enum class SignatureFit : std::uint8_t {
    none,        // the case has no signature
    fits,        // it is as the holder of the key left it
    differs,     // changed since, or the signature of another case
    unreadable,  // damaged, or of a newer version
};

struct CaseSignature {
    SignatureFit fit = SignatureFit::none;
    // What follows is set where `fit` is `fits` or `differs`. The name is what the signer wrote:
    // anybody can write any name, so that the key alone says who it was.
    std::string name;
    PublicKey key{};
};

// Checks a file bit by bit, for a page that draws pictures meanwhile. file: a whole bundle, which
// must outlive the check.
class SignatureCheck {
  public:
    explicit SignatureCheck(std::span<const std::uint8_t> file);
    ~SignatureCheck();
    SignatureCheck(SignatureCheck&&) noexcept;
    SignatureCheck& operator=(SignatureCheck&&) noexcept;

    // Looks at up to 1 MiB more. True: done. Cost: a few ms.
    bool step();
    const CaseSignature& result() const { return result_; }  // after step() was true

  private:
    struct State;
    std::unique_ptr<State> state_;  // null: done
    CaseSignature result_;
};

// The same at once. Cost: some 2 ms per MB of a signed case's contents; nothing without signature.
CaseSignature signature_of(std::span<const std::uint8_t> file);

// Whether an author can be named so: 1 to 128 bytes of UTF-8, without control characters and those
// that turn the direction of what follows, as it is shown beside words of the program.
bool can_sign_as(std::string_view name);

// The case with a signature, in place of one that it has; all other chunks hold the same.
// Errors: a name for which can_sign_as() is false; bytes that are not a bundle.
Result<std::vector<std::uint8_t>> signed_case(std::span<const std::uint8_t> file,
                                              const SigningKey& key,
                                              std::string_view name,
                                              const std::string& where,
                                              JobRunner& jobs = serial_jobs());

}  // namespace sonocase
