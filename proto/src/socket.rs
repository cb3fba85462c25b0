//! The control socket: one connection for each client, messages kept whole, answers that reach only
//! this client, and an immediate report by the kernel when the other side dies.
//!
//! The socket lies in the server's folder; it is addressed through that folder's descriptor, so
//! that the length of the path does not matter.

use std::fs::File;
use std::io::{self, ErrorKind, IoSlice, IoSliceMut};
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{AtFlags, OFlags, unlinkat};
use rustix::net::{
    AddressFamily, RecvAncillaryBuffer, RecvAncillaryMessage, RecvFlags, ReturnFlags,
    SendAncillaryBuffer, SendAncillaryMessage, SendFlags, SocketAddrUnix, SocketFlags, SocketType,
    accept_with, bind, connect, listen, recvmsg, sendmsg, socket_with, sockopt,
};

/// Name of the socket in a server's folder.
const SOCKET: &str = "control";
/// Connections that may wait to be accepted.
const BACKLOG: i32 = 1024;
/// The longest message `[byte]`.
pub const MAX_MESSAGE: usize = 128 << 10;

/// The server's end, which accepts connections.
#[derive(Debug)]
pub struct ControlListener {
    socket: OwnedFd,
    folder: File,
    /// Device and inode.
    file: (u64, u64),
}

/// One end of a connection. Nothing here blocks but [`ControlSocket::wait`].
#[derive(Debug)]
pub struct ControlSocket {
    socket: OwnedFd,
}

/// The process at the other end of a connection, as reported by the kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Peer {
    /// Process; 0 if it is in another namespace.
    pub process: u32,
    /// User.
    pub user: u32,
}

impl ControlListener {
    /// Listens in this folder; replaces the socket of a dead server.
    pub fn new(folder: &Path) -> io::Result<ControlListener> {
        let folder = open_folder(folder)?;
        let socket = new_socket()?;
        match unlinkat(&folder, SOCKET, AtFlags::empty()) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(error.into()),
            _ => {}
        }
        bind(&socket, &address(&folder)?)?;
        listen(&socket, BACKLOG)?;
        let found = rustix::fs::statat(&folder, SOCKET, AtFlags::SYMLINK_NOFOLLOW)?;
        Ok(ControlListener { socket, folder, file: (found.st_dev, found.st_ino) })
    }

    /// The next connection, if one waits.
    pub fn accept(&self) -> io::Result<Option<ControlSocket>> {
        match accept_with(&self.socket, SocketFlags::CLOEXEC | SocketFlags::NONBLOCK) {
            Ok(socket) => Ok(Some(ControlSocket { socket })),
            Err(error) if error.kind() == ErrorKind::WouldBlock => Ok(None),
            // the client left while it waited
            Err(rustix::io::Errno::CONNABORTED) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    /// True while new clients find this socket at `folder`; cleaners of temporary files may remove
    /// it.
    pub fn is_reachable(&self, folder: &Path) -> bool {
        let found = rustix::fs::lstat(folder.join(SOCKET));
        found.is_ok_and(|found| (found.st_dev, found.st_ino) == self.file)
    }

    /// Removes the socket's name: no new client connects.
    pub fn unlink(&self) {
        let _ = unlinkat(&self.folder, SOCKET, AtFlags::empty());
    }
}

impl AsFd for ControlListener {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }
}

impl ControlSocket {
    /// Connects to the server of this folder.
    ///
    /// # Errors
    /// `NotFound` and `ConnectionRefused`: no server is running. `WouldBlock`: too many wait.
    pub fn connect(folder: &Path) -> io::Result<ControlSocket> {
        let folder = open_folder(folder)?;
        let socket = new_socket()?;
        connect(&socket, &address(&folder)?)?;
        Ok(ControlSocket { socket })
    }

    /// The process at the other end.
    pub fn peer(&self) -> io::Result<Peer> {
        let credentials = sockopt::socket_peercred(&self.socket)?;
        Ok(Peer {
            process: credentials.pid.as_raw_pid().unsigned_abs(),
            user: credentials.uid.as_raw(),
        })
    }

    /// Sends a message, and a descriptor with it.
    ///
    /// # Errors
    /// `WouldBlock` if the other side does not read, `BrokenPipe` if it is gone.
    pub fn send(&self, message: &[u8], descriptor: Option<BorrowedFd<'_>>) -> io::Result<()> {
        let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(1))];
        let mut ancillary = SendAncillaryBuffer::new(&mut space);
        let descriptors = descriptor.map(|one| [one]);
        if let Some(descriptors) = &descriptors {
            ancillary.push(SendAncillaryMessage::ScmRights(descriptors));
        }
        let flags = SendFlags::NOSIGNAL | SendFlags::DONTWAIT;
        sendmsg(&self.socket, &[IoSlice::new(message)], &mut ancillary, flags)?;
        Ok(())
    }

    /// The next message, with its descriptor if it has one; `None` without a message.
    ///
    /// # Errors
    /// `UnexpectedEof` and `ConnectionReset`: the other side is gone; `InvalidData`: the message is
    /// longer than the buffer.
    pub fn receive(&self, buffer: &mut [u8]) -> io::Result<Option<(usize, Option<OwnedFd>)>> {
        let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(1))];
        let mut ancillary = RecvAncillaryBuffer::new(&mut space);
        let flags = RecvFlags::DONTWAIT | RecvFlags::CMSG_CLOEXEC;
        let got = match recvmsg(&self.socket, &mut [IoSliceMut::new(buffer)], &mut ancillary, flags)
        {
            Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(None),
            outcome => outcome?,
        };
        let descriptor = ancillary.drain().find_map(|message| match message {
            RecvAncillaryMessage::ScmRights(mut descriptors) => descriptors.next(),
            _ => None,
        });
        match got.bytes {
            0 => Err(ErrorKind::UnexpectedEof.into()),
            _ if got.flags.contains(ReturnFlags::TRUNC) => Err(ErrorKind::InvalidData.into()),
            bytes => Ok(Some((bytes, descriptor))),
        }
    }

    /// Waits until there is something to receive or the other side is gone; false at the deadline.
    pub fn wait(&self, deadline: Instant) -> io::Result<bool> {
        let left = deadline.saturating_duration_since(Instant::now());
        let mut poll_fds = [PollFd::new(&self.socket, PollFlags::IN)];
        match poll(&mut poll_fds, Some(&timespec(left))) {
            Err(rustix::io::Errno::INTR) => Ok(Instant::now() < deadline),
            outcome => Ok(outcome? > 0),
        }
    }

    /// True once the other side is gone, even if messages from it still wait.
    pub fn is_closed(&self) -> bool {
        let mut poll_fds = [PollFd::new(&self.socket, PollFlags::empty())];
        match poll(&mut poll_fds, Some(&timespec(Duration::ZERO))) {
            Ok(_) => poll_fds[0].revents().intersects(PollFlags::HUP | PollFlags::ERR),
            Err(error) => error.kind() != ErrorKind::Interrupted,
        }
    }
}

impl AsFd for ControlSocket {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }
}

/// A duration for system calls.
pub fn timespec(span: Duration) -> Timespec {
    // a thousand years at most
    Timespec { tv_sec: span.as_secs().min(1 << 35) as i64, tv_nsec: i64::from(span.subsec_nanos()) }
}

fn new_socket() -> io::Result<OwnedFd> {
    let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
    Ok(socket_with(AddressFamily::UNIX, SocketType::SEQPACKET, flags, None)?)
}

fn open_folder(folder: &Path) -> io::Result<File> {
    let flags = OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC | OFlags::RDONLY;
    Ok(rustix::fs::open(folder, flags, rustix::fs::Mode::empty())?.into())
}

fn address(folder: &File) -> io::Result<SocketAddrUnix> {
    let path: PathBuf = ["/proc/self/fd", &folder.as_raw_fd().to_string(), SOCKET].iter().collect();
    Ok(SocketAddrUnix::new(path)?)
}
