// SPDX-License-Identifier: MIT
// The checksum of zip (CRC-32, polynomial 0x04C11DB7, reflected). Host only; no further library.
#pragma once
#include <cstdint>
#include <string_view>

namespace padder {

// The checksum of `bytes`, or, with the checksum of what comes before them, that of the whole.
std::uint32_t crc32(std::string_view bytes, std::uint32_t before = 0);

// The checksum of two pieces one after the other from those of each and the size of the second: pieces can
// be summed by several threads. Takes some microseconds, whatever the size.
std::uint32_t crc32_joined(std::uint32_t first, std::uint32_t second, std::uint64_t size_of_second);

}  // namespace padder
