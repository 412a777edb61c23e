//! The servers of the network: which site, which places and which encryption belong to each listener.

use std::sync::Arc;

use classroom::{ClassInfo, Classroom, MOST_PUPILS};
use tokio::net::TcpListener;
use tokio_rustls::TlsAcceptor;

use super::admission::{ConnectionAdmission, Places};
use super::byte_server::ByteServer;
use super::class::Class;
use super::class_site::{self, ClassSite};
use super::config::ServerConfig;
use super::descriptors;
#[cfg(unix)]
use super::local_socket::LocalSocket;
use super::notice::Notices;
use super::shared::SharedHub;
use super::site::{ClassConfig, PageConfig, PageSite, Site};
#[cfg(not(unix))]
use super::unsupported::LocalSocket;
use super::web_server::WebServer;

/// Connections that a browser opens to load the page. All pupils may load it at the same time.
const FILES_OF_EACH_TAB: usize = 4;
/// Tabs that are being told why they are refused.
const REFUSED_TABS: usize = 8;
/// Teacher's screens, and sessions with the arm of a class.
const OTHER_TABS: usize = 8;
/// The places of a class.
const PLACES: Places = Places {
    clients: MOST_PUPILS + REFUSED_TABS,
    reserved: OTHER_TABS,
    unknown: FILES_OF_EACH_TAB * MOST_PUPILS,
};

/// What the connections of the network share.
pub(super) struct Network {
    pub(super) shared: Arc<SharedHub>,
    pub(super) notices: Notices,
    pub(super) tls: Option<TlsAcceptor>,
}

impl Network {
    /// Serves the listeners that are open. [`Network::spawn_class`] serves the class.
    pub(super) fn spawn(
        self,
        config: &ServerConfig,
        socket: Option<LocalSocket>,
        tcp: Option<TcpListener>,
        web_socket: Option<TcpListener>,
        page: Option<TcpListener>,
    ) {
        let most = descriptors::connections();
        let admission = ConnectionAdmission::new(most);
        // Programs of this user keep their places whatever the network does.
        let local = ByteServer {
            admission: ConnectionAdmission::new(most),
            token: None,
            tls: None,
            ..self.bytes(config, &admission)
        };
        socket.into_iter().for_each(|socket| drop(tokio::spawn(local.clone().serve_local(socket))));
        if let Some(listener) = tcp {
            tokio::spawn(self.bytes(config, &admission).serve_tcp(listener));
        }
        if let Some(listener) = web_socket {
            let site = Site::Maker(config.access.clone());
            tokio::spawn(self.web(site, self.tls.clone(), &admission).serve(listener));
        }
        if let (Some(listener), Some(PageConfig { token, files, .. })) = (page, &config.page) {
            let (files, token, has_arm) = (*files, token.clone(), config.arm.is_some());
            let site = Site::Page(PageSite { files, token, has_arm });
            tokio::spawn(self.web(site, None, &admission).serve(listener));
        }
    }

    /// Serves the class, if there is one.
    pub(super) fn spawn_class(&self, config: &ServerConfig, listener: Option<TcpListener>) {
        let (Some(listener), Some(settings)) = (listener, config.class.clone()) else { return };
        let ClassConfig { files, code, secret, hosts, new_key, .. } = settings;
        let port = listener.local_addr().map_or(0, |address| address.port());
        let is_encrypted = self.tls.is_some();
        let addresses = hosts.into_iter().map(|host| class_site::page(host, port, is_encrypted)).collect();
        let info = ClassInfo { addresses, code: code.clone(), has_arm: config.arm.is_some() };
        let class = Class::new(Arc::clone(&self.shared), Classroom::new(info));
        tokio::spawn(Arc::clone(&class).run());
        let site = Site::Class(ClassSite { files, code, secret, class: Arc::clone(&class), is_encrypted });
        let server =
            self.web(site, self.tls.clone(), &ConnectionAdmission::with(descriptors::fitting(PLACES)));
        tokio::spawn(WebServer { class: Some((class, new_key)), ..server }.serve(listener));
    }

    fn bytes(&self, config: &ServerConfig, admission: &Arc<ConnectionAdmission>) -> ByteServer {
        ByteServer {
            shared: Arc::clone(&self.shared),
            admission: Arc::clone(admission),
            notices: self.notices.clone(),
            token: config.access.token.clone(),
            tls: self.tls.clone(),
        }
    }

    fn web(&self, site: Site, tls: Option<TlsAcceptor>, admission: &Arc<ConnectionAdmission>) -> WebServer {
        WebServer {
            shared: Arc::clone(&self.shared),
            admission: Arc::clone(admission),
            notices: self.notices.clone(),
            site,
            tls,
            class: None,
        }
    }
}
