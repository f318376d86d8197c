# SPDX-License-Identifier: MIT
# The headers carry plain comments; this shows them to Doxygen as its own: those above a declaration as ///, those
# behind one as ///<, the one a file begins with as the file's. In Markdown a quote inside a span of code, which Doxygen
# takes for the span's end, becomes another character, and a drawing loses its folder: Doxygen finds drawings by name.
FILENAME ~ /\.md$/ {
  pieces = split($0, piece, "`")
  line = piece[1]
  for (k = 2; k <= pieces; k++) {
    if (k % 2 == 0) gsub(/'/, "\342\200\231", piece[k])
    line = line "`" piece[k]
  }
  gsub(/\]\(\.\.\/drawings\//, "](", line)
  print line
  next
}
FNR == 1 { head = 1; behind = 0 }
/^#/ { head = behind = 0; print; next }
{
  at = match($0, /\/\/ /)
  code = at ? substr($0, 1, at - 1) : $0
  text = at ? substr($0, at + 3) : ""
  if (!at || gsub(/"/, "\"", code) % 2) { behind = 0; print; next }  # none, or inside a string
  if (code ~ /^ *$/) {
    if (behind == at) { print code "///< " text; next }
    behind = 0
    if (head == 1) { print "/// @file"; head = 2 }
    print code "/// " text
  } else if (code ~ /^ *}/ && text ~ /^namespace/) {
    behind = 0
    print code
  } else {
    behind = at
    print code "///< " text
  }
}
