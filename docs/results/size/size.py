#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""size.py PROGRAM [libcudart_static.a]: where the bytes of a program that links the detector go.

Prints the sections of the file, the host's symbols by owner, then what each GPU kernel takes in all its instances. A cubin (the GPU code of one
source file for one architecture) is an ELF file inside the section .nv_fatbin, which NVIDIA does not document; the few
fields read here are those that `cuobjdump --list-elf` lists. Standard library, nm and c++filt only.
"""
import collections
import re
import struct
import subprocess
import sys

DEBUG = ('.debug_', '.nv_debug_', '.rel.debug_', '.rela.debug_', '.rel.nv_debug_', '.rela.nv_debug_')


def sections(elf):
    """Name and size of each section of a 64-bit ELF file."""
    table, = struct.unpack_from('<Q', elf, 40)
    entry, count, names = struct.unpack_from('<HHH', elf, 58)
    rows = [struct.unpack_from('<IIQQQQIIQQ', elf, table + k * entry) for k in range(count)]
    at = rows[names][4]
    for name, kind, _, _, offset, size, *_ in rows:
        start = at + name
        yield elf[start:elf.index(b'\0', start)].decode(), 0 if kind == 8 else size, offset


def fatbin_entries(data):
    """Kind (1: PTX, 2: cubin), architecture, compressed or not, and bytes of each entry; and the number of its file."""
    at = number = 0
    while at < len(data) - 16:
        magic, _, header, size = struct.unpack_from('<IHHQ', data, at)
        if magic != 0xBA55ED50:
            at += 8
            continue
        entry, end = at + header, at + header + size
        while entry < end:
            kind, _, head, length = struct.unpack_from('<HHIQ', data, entry)
            arch, = struct.unpack_from('<I', data, entry + 28)
            yield number, kind, arch, data[entry + head:entry + head + length]
            entry += head + length
        at, number = end, number + 1


def demangled(names):
    text = subprocess.run(['c++filt'], input='\n'.join(names), capture_output=True, text=True, check=True).stdout
    return dict(zip(names, text.split('\n')))


def short(name):
    """A kernel without its namespace, template arguments and parameters."""
    name = name.replace('(anonymous namespace)::', '')
    depth, out = 0, ''
    for c in name:
        depth += c == '<'
        if depth == 0:
            out += c
        depth -= c == '>'
    return re.split(r'[\s:]', out.split('(')[0].strip())[-1]


def table(head, rows):
    print('| ' + ' | '.join(head) + ' |\n|' + ' --- |' + ' ---: |' * (len(head) - 1))
    for row in rows:
        print('| ' + ' | '.join(f'{v:,}' if isinstance(v, int) else v for v in row) + ' |')
    print()


def symbols(path, *options):
    """Size and name of each symbol that the file defines."""
    text = subprocess.run(['nm', '-S', '--defined-only', *options, path], capture_output=True, text=True).stdout
    return [(int(w[1], 16), w[3]) for w in map(str.split, text.split('\n')) if len(w) == 4]


def host_table():
    runtime = {name for _, name in symbols(sys.argv[2])} if len(sys.argv) > 2 else set()
    owners = [('6padder6detect', 'the detector'), ('6padder', 'padder: clusters and files'), ('nlohmann', 'nlohmann_json'),
              ('CLI', 'CLI11'), ('3cub', 'CUB'), ('St', 'the C++ library')]
    total = collections.Counter()
    for size, name in symbols(sys.argv[1]):
        owner = next((owner for part, owner in owners if part in name), 'others')
        total['the CUDA runtime' if name in runtime else owner] += size
    table(('symbols of the host', 'bytes'), total.most_common())


def main():
    program = open(sys.argv[1], 'rb').read()
    parts = list(sections(program))
    table(('section', 'bytes'), [(f'`{n}`', s) for n, s, _ in sorted(parts, key=lambda p: -p[1])[:6]] +
          [('the file', len(program))])
    host_table()
    fat = next(((size, offset) for name, size, offset in parts if name == '.nv_fatbin'), None)
    if fat is None:
        return
    kinds = collections.Counter()
    kernels = collections.defaultdict(collections.Counter)
    files = collections.defaultdict(collections.Counter)
    mangled = {}
    for number, kind, arch, data in fatbin_entries(program[fat[1]:fat[1] + fat[0]]):
        if kind == 1:
            kinds[f'PTX for compute {arch / 10}'] += len(data)
            files[number]['ptx'] += len(data)
            continue
        inside = list(sections(data))
        for name, size, _ in inside:
            what = ('code' if name.startswith('.text.') else 'line tables (-lineinfo)' if name.startswith(DEBUG)
                    else 'what the driver needs of each kernel, names')
            kinds[f'cubin for sm_{arch}: {what}'] += size
            files[number]['code' if what == 'code' else 'lines' if what.startswith('line') else 'rest'] += size
            match = re.match(r'(?:\.rela?)?\.(?:text|nv_debug_line_sass|nv\.info|nv\.constant\d|nv\.shared|nv\.merc\S*?)\.(_Z.*)', name)
            if match:
                mangled.setdefault(match[1], None)
                kernels[match[1]]['code' if what == 'code' else 'rest'] += size
                if what == 'code':
                    kernels[match[1]]['instances'] += 1
                    files[number].setdefault('names', 0)
                    files[number, 'names'][match[1]] += 1
    plain = demangled(list(mangled))
    table(('in `.nv_fatbin`', 'bytes'), sorted(kinds.items(), key=lambda k: -k[1]))
    rows = []
    for number in [k for k in files if isinstance(k, int)]:
        names = collections.Counter(short(plain[m]) for m in files[number, 'names'])
        of = files[number]
        if not names:
            continue
        total = of['code'] + of['lines'] + of['rest'] + of['ptx']
        rows.append((', '.join(f'`{n}`' for n in sorted(names)), sum(names.values()), of['code'], of['lines'], of['rest'],
                     of['ptx'], total))
    table(('kernels of one source file', 'instances', 'code', 'line tables', 'the rest of the cubin', 'PTX', 'all'),
          sorted(rows, key=lambda r: -r[-1]))
    by_kernel = collections.defaultdict(lambda: [0, 0])
    for m, of in kernels.items():
        by_kernel[short(plain[m])][0] += of['instances']
        by_kernel[short(plain[m])][1] += of['code']
    table(('kernel', 'instances', 'bytes of code'),
          [(f'`{n}`', *v) for n, v in sorted(by_kernel.items(), key=lambda k: -k[1][1])[:12]])


main()
