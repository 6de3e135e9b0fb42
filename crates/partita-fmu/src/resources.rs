//! The location of the resources: the URI given by the environment, as a path.

use std::path::PathBuf;

/// The path of a `file:` URI; a path without a scheme is used unchanged.
///
/// # Errors
/// The URI names no file, or is not well formed.
pub fn path(uri: &str) -> Result<PathBuf, String> {
    let Some(rest) = uri.strip_prefix("file:") else {
        return match uri.contains("://") {
            true => Err(format!("the location of the resources is {uri}, which is not a file: URI")),
            false => Ok(PathBuf::from(uri)),
        };
    };
    // file:///path, file://localhost/path, file:/path
    let rest = rest.strip_prefix("//").map_or(rest, |x| x.strip_prefix("localhost").unwrap_or(x));
    let decoded = decoded(rest).ok_or_else(|| format!("the URI of the resources is not well formed: {uri}"))?;
    let drive = decoded.as_bytes().get(2) == Some(&b':') && cfg!(windows);
    Ok(PathBuf::from(if drive { decoded.trim_start_matches('/') } else { &decoded[..] }))
}

/// The text with %XX replaced by the bytes that they stand for.
fn decoded(text: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.bytes();
    while let Some(byte) = rest.next() {
        if byte == b'%' {
            let digits = [rest.next()?, rest.next()?];
            let digits = std::str::from_utf8(&digits).ok()?;
            bytes.push(u8::from_str_radix(digits, 16).ok()?);
        } else {
            bytes.push(byte);
        }
    }
    String::from_utf8(bytes).ok()
}
