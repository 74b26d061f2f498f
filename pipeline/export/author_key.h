// SPDX-License-Identifier: Apache-2.0

// The files of an author's key, PEM as OpenSSL and other programs read and write them
// (RFC 8410): "openssl genpkey -algorithm ed25519" makes the same. A line "Name: ..." before the
// key says who the author is; other programs pass over it.
#pragma once

#include <string>
#include <string_view>

#include "formats/base/result.h"
#include "formats/bundle/signature.h"

namespace sonocase::pipeline::inline exporting {

struct AuthorKey {
    SigningKey key;
    std::string name;  // empty: the file says none
};

// A key that nobody else has, from the system's random numbers.
AuthorKey new_author_key(const std::string& name);

// The text of the file that the author keeps, and of the one that the author gives away.
std::string private_key_text(const AuthorKey& key);
std::string public_key_text(const PublicKey& key, const std::string& name);

// Errors: text that is no such key; one that is encrypted.
Result<AuthorKey> parse_author_key(std::string_view text, const std::string& where);
// Takes the public key from either file. Errors: as for the whole key.
Result<PublicKey> parse_public_key(std::string_view text, const std::string& where);

// "signed by NAME (fingerprint ...)" and the like; empty: the case has no signature.
std::string signature_words(const CaseSignature& signature);

}  // namespace sonocase::pipeline::inline exporting
