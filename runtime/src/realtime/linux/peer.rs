//! Identity of the process at the other end of a socket, from the kernel.

use std::os::fd::{AsFd, AsRawFd};

/// Process and user that connected `socket`; `None` on an error. Process 0 is in a PID namespace not visible here.
pub fn peer_of(socket: impl AsFd) -> Option<(i32, u32)> {
    let mut peer = libc::ucred { pid: 0, uid: 0, gid: 0 };
    let mut length = size_of::<libc::ucred>() as libc::socklen_t;
    // SAFETY: `peer` and `length` live across the call, which writes no more than `length` bytes to `peer`, for which
    // every bit pattern is valid. The descriptor is open as long as `socket` is borrowed.
    let failed = unsafe {
        let (peer, length) = ((&raw mut peer).cast(), &raw mut length);
        libc::getsockopt(socket.as_fd().as_raw_fd(), libc::SOL_SOCKET, libc::SO_PEERCRED, peer, length)
    };
    (failed == 0).then_some((peer.pid, peer.uid))
}
